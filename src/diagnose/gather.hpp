/* What is explained together: recordings split into series, gated, put together by channel, thinned where too long. */
#ifndef TACTUS_DIAGNOSE_GATHER_HPP
#define TACTUS_DIAGNOSE_GATHER_HPP

#include <tactus/diagnose.h>

#include <map>
#include <utility>
#include <vector>

#include "diagnose/dependence.hpp"
#include "diagnose/report.hpp"

namespace tactus::explain
{

/* A recording and what it was split into. */
struct Recording {
	const tactus_table *table;
	tactus_series *series = nullptr;
	size_t count = 0;
	std::vector<std::vector<std::vector<char>>> use; /* series, output, sample */

	explicit Recording(const tactus_table *t) : table(t)
	{
	}
	Recording(const Recording &) = delete;
	Recording(Recording &&other) noexcept
		: table(other.table), series(other.series), count(other.count), use(std::move(other.use))
	{
		other.series = nullptr;
	}
	~Recording()
	{
		tactus_series_free(series, count);
	}
};

class Gathered
{
  public:
	Gathered(const tactus_table *const *tables, size_t count, const tactus_diagnose_options &o) : options(o)
	{
		for (size_t i = 0; i < count; i++)
			recordings.emplace_back(tables[i]);
	}
	/* Problems of the recordings go to the store. A code of tactus/error.h. */
	int run(Store &store);
	/* The columns of a series that neither its domain nor this program has a use for. */
	std::vector<Extra> extras(const Work &work) const;

	std::vector<Recording> recordings;
	std::vector<Work> works;                 /* in the order of their channels */
	std::map<int, std::vector<size_t>> wild; /* per channel: rows of readings that are left out from the start */

  private:
	int split();
	int gate(Store &store);
	void gather();
	void prepare(Work &work);

	const tactus_diagnose_options &options;
	std::vector<std::vector<std::pair<size_t, size_t>>> members; /* per work: recording, series */
	std::map<int, const char *> hopeless;                        /* per channel; 0: all */
};

} // namespace tactus::explain

#endif
