/* Recordings split, gated, put together by channel and thinned. */
#include "diagnose/gather.hpp"

#include <algorithm>
#include <cmath>

#include "core/core.h"
#include "diagnose/gates.h"
#include "diagnose/noise.hpp"
#include "model/columns.h"

namespace tactus::explain
{

namespace
{

const size_t most_samples = 40000; /* of a series that are looked at; a longer one is thinned */

/* Every stride-th sample of a series, with copies of its own. */
tactus_series thin(const tactus_series &s, size_t stride, std::vector<std::vector<double>> &buffers)
{
	tactus_series result = s;
	result.n = (s.n + stride - 1) / stride;
	for (size_t k = 0; k < s.domain->signal_count; k++) {
		if (!s.signal[k])
			continue;
		std::vector<double> kept;
		for (size_t i = 0; i < s.n; i += stride)
			kept.push_back(s.signal[k][i]);
		buffers.push_back(std::move(kept));
		result.signal[k] = buffers.back().data();
	}
	result.dt = s.dt * double(stride);
	return result;
}

/* Not a multiple of what comes in turn (dc and ac rows, eight channels). */
size_t odd(size_t stride)
{
	while (stride > 1 && (stride % 2 == 0 || stride % 3 == 0 || stride % 5 == 0))
		stride++;
	return stride;
}

const char *const computed[] = {"resistance_ohm",
								"conductance_S",
								"capacitance_F",
								"amplitude_V",
								"phase_rad",
								"detector_amplitude_V",
								"detector_phase_V",
								"detector_dc_V",
								"sequence",
								"channel",
								"time_s",
								"reference_resistance_ohm",
								"reference_capacitance_F",
								"force_estimate_N"};

/* True if a column is an output in another unit or form (counts that a conductance was computed from): same order. */
bool restates_output(const tactus_table *table, const char *name, const tactus_series &series)
{
	const double *values = tactus_table_numbers(table, name);
	for (size_t s = 0; values && s < series.domain->signal_count; s++) {
		if (series.domain->signals[s].role != TACTUS_ROLE_OUTPUT || !series.signal[s])
			continue;
		std::vector<std::pair<double, double>> pairs;
		for (size_t i = 0; i < series.n; i++)
			if (std::isfinite(values[series.row[i]]) && std::isfinite(series.signal[s][i]))
				pairs.emplace_back(values[series.row[i]], series.signal[s][i]);
		/* Equal values stay as they came: the order of the outputs among them must not decide. */
		std::stable_sort(pairs.begin(), pairs.end(), [](const auto &a, const auto &b) { return a.first < b.first; });
		size_t up = 0, down = 0;
		for (size_t i = 1; i < pairs.size(); i++)
			if (pairs[i].first > pairs[i - 1].first) {
				up += pairs[i].second > pairs[i - 1].second;
				down += pairs[i].second < pairs[i - 1].second;
			}
		if (up + down >= 20 && std::min(up, down) * 50 <= up + down)
			return true;
	}
	return false;
}

} // namespace

int Gathered::split()
{
	for (Recording &r : recordings) {
		tactus_series_options how = {options.domain, options.input, options.output, false};
		int status = options.model ? tactus_columns_of_model(r.table, options.model, &how) : TACTUS_OK;
		if (status == TACTUS_OK)
			status = tactus_series_split(r.table, &how, &r.series, &r.count);
		if (status != TACTUS_OK)
			return status;
		if (r.series->domain != recordings.front().series->domain)
			return tactus_fail(TACTUS_ERR_INPUT, "%s is of domain %s, %s of %s: diagnose them apart",
							   tactus_table_file(r.table), r.series->domain->name,
							   tactus_table_file(recordings.front().table), recordings.front().series->domain->name);
		for (size_t c = 0; c < r.count; c++) {
			std::vector<std::vector<char>> outputs;
			const tactus_series &s = r.series[c];
			for (size_t signal = 0; signal < s.domain->signal_count; signal++) {
				if (s.domain->signals[signal].role != TACTUS_ROLE_OUTPUT)
					continue;
				std::vector<char> use(s.n, 0);
				for (size_t i = 0; s.signal[signal] && i < s.n; i++) {
					bool whole = std::isfinite(s.signal[signal][i]);
					for (size_t k = 0; k < s.domain->signal_count; k++)
						if (s.domain->signals[k].role == TACTUS_ROLE_INPUT && std::isnan(s.domain->signals[k].fill))
							whole = whole && s.signal[k] && std::isfinite(s.signal[k][i]);
					use[i] = whole;
				}
				if (s.domain->loaded)
					for (const size_t i : find_wild(&s, s.signal[signal], use))
						wild[s.channel].push_back(s.row[i]);
				outputs.push_back(std::move(use));
			}
			r.use.push_back(std::move(outputs));
		}
	}
	if (options.model && options.model->domain != recordings.front().series->domain)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED, "the model is of domain %s, the recording of %s",
						   options.model->domain->name, recordings.front().series->domain->name);
	return TACTUS_OK;
}

int Gathered::gate(Store &store)
{
	for (size_t k = 0; k < recordings.size(); k++) {
		Recording &r = recordings[k];
		std::vector<std::vector<bool *>> rows;
		std::vector<bool *const *> channels;
		std::deque<std::unique_ptr<bool[]>> flags;
		for (size_t c = 0; c < r.count; c++) {
			rows.emplace_back();
			for (const std::vector<char> &use : r.use[c]) {
				flags.emplace_back(new bool[use.size() + 1]);
				std::copy(use.begin(), use.end(), flags.back().get());
				rows.back().push_back(flags.back().get());
			}
			rows.back().push_back(nullptr);
		}
		channels.reserve(rows.size());
		for (const std::vector<bool *> &row : rows)
			channels.push_back(row.data());
		tactus_gate_problems found = {nullptr, 0, 0};
		const int status = tactus_gates(r.table, r.series, r.count, channels.data(), &found);
		for (size_t i = 0; i < found.count; i++) {
			const tactus_gate_problem &p = found.items[i];
			store.problems.push_back({p.kind, store.text(p.text), k, r.series->domain->by_channel ? p.channel : 0,
									  p.fatal, store.keep(std::vector<size_t>(p.rows, p.rows + p.row_count)),
									  p.row_count});
			if (p.fatal)
				hopeless[p.channel] = store.problems.back().text;
		}
		tactus_gates_free(&found);
		if (status != TACTUS_OK)
			return status;
		for (size_t c = 0; c < r.count; c++)
			for (size_t o = 0; o < r.use[c].size(); o++)
				std::copy_n(rows[c][o], r.use[c][o].size(), r.use[c][o].begin());
	}
	return TACTUS_OK;
}

/* Series of one channel in all recordings belong together. */
void Gathered::gather()
{
	for (size_t k = 0; k < recordings.size(); k++)
		for (size_t c = 0; c < recordings[k].count; c++) {
			const int channel = recordings[k].series[c].channel;
			size_t at = 0;
			while (at < works.size() && works[at].channel != channel)
				at++;
			if (at == works.size()) {
				works.emplace_back();
				works.back().channel = channel;
				members.emplace_back();
			}
			members[at].emplace_back(k, c);
		}
	std::vector<size_t> order(works.size());
	for (size_t i = 0; i < order.size(); i++)
		order[i] = i;
	std::stable_sort(order.begin(), order.end(),
					 [&](size_t a, size_t b) { return works[a].channel < works[b].channel; });
	std::vector<Work> sorted;
	std::vector<std::vector<std::pair<size_t, size_t>>> sorted_members;
	for (const size_t i : order) {
		sorted.push_back(std::move(works[i]));
		sorted_members.push_back(std::move(members[i]));
	}
	works = std::move(sorted);
	members = std::move(sorted_members);
}

std::vector<Extra> Gathered::extras(const Work &work) const
{
	const std::vector<std::pair<size_t, size_t>> &own = members[size_t(&work - works.data())];
	std::vector<Extra> result;
	const Recording &first = recordings[own.front().first];
	const tactus_series &series = first.series[own.front().second];
	for (size_t column = 0; column < tactus_table_columns(first.table) && result.size() < 40; column++) {
		const std::string name = tactus_table_name(first.table, column);
		if (tactus_table_type(first.table, column) != TACTUS_COLUMN_NUMBER || name.find("_std") != std::string::npos ||
			name == series.input_name)
			continue;
		bool known = std::any_of(std::begin(computed), std::end(computed), [&](const char *c) { return name == c; });
		for (const char *output : series.output_name)
			known = known || (output && name == output);
		for (size_t s = 0; s < series.domain->signal_count; s++)
			known = known || (name == series.domain->signals[s].name && series.recorded[s]);
		if (known || restates_output(first.table, name.c_str(), series))
			continue;
		Extra extra{name, {}};
		for (const auto &[k, c] : own) {
			const double *values = tactus_table_numbers(recordings[k].table, name.c_str());
			const tactus_series &s = recordings[k].series[c];
			std::vector<double> at;
			for (size_t i = 0; i < s.n; i += work.every)
				at.push_back(values ? values[s.row[i]] : NAN);
			extra.values.push_back(std::move(at));
		}
		result.push_back(std::move(extra));
	}
	return result;
}

void Gathered::prepare(Work &work)
{
	const auto at = size_t(&work - works.data());
	size_t longest = 0;
	for (const auto &[k, c] : members[at])
		longest += recordings[k].series[c].n;
	work.every = odd((longest + most_samples - 1) / most_samples);
	std::vector<const tactus_series *> segments;
	std::vector<std::vector<std::vector<char>>> use;
	work.thinned.reserve(members[at].size());
	for (const auto &[k, c] : members[at]) {
		const Recording &r = recordings[k];
		work.sequence.push_back(tactus_table_numbers(r.table, "sequence"));
		if (work.every == 1) {
			segments.push_back(&r.series[c]);
			use.push_back(r.use[c]);
			continue;
		}
		work.buffers.reserve(work.buffers.size() + TACTUS_SIGNALS_MAX);
		work.thinned.push_back(thin(r.series[c], work.every, work.buffers));
		segments.push_back(&work.thinned.back());
		use.emplace_back();
		for (const std::vector<char> &all : r.use[c]) {
			std::vector<char> kept;
			for (size_t i = 0; i < all.size(); i += work.every)
				kept.push_back(all[i]);
			use.back().push_back(std::move(kept));
		}
	}
	const tactus_series *first = segments.front();
	work.input_name = first->input_name ? first->input_name : "";
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		work.output_name[o] = "";
		for (const tactus_series *series : segments)
			if (work.output_name[o].empty() && series->output_name[o])
				work.output_name[o] = series->output_name[o];
		const size_t suffix = work.output_name[o].rfind('_');
		work.output_unit[o] = suffix == std::string::npos ? "" : work.output_name[o].substr(suffix + 1);
	}
	work.problem = std::make_unique<Problem>(segments, use);
	work.problem->thinned = work.every > 1;
	const auto fatal = hopeless.find(work.channel);
	work.hopeless = fatal != hopeless.end() ? fatal->second : hopeless.count(0) ? hopeless[0] : nullptr;
	if (!work.hopeless && work.problem->rows() < 20)
		work.hopeless = "fewer than 20 readings change with anything";
}

int Gathered::run(Store &store)
{
	int status = split();
	if (status == TACTUS_OK)
		status = gate(store);
	if (status != TACTUS_OK)
		return status;
	gather();
	for (Work &work : works)
		prepare(work);
	return TACTUS_OK;
}

} // namespace tactus::explain
