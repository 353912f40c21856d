/* Recordings in, a diagnosis out: split, gated, explained series by series, put together. */
#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <map>

#include <tactus/version.h>

#include "core/core.h"
#include "diagnose/gates.h"
#include "diagnose/noise.hpp"
#include "diagnose/report.hpp"
#include "fit/fit_work.h"
#include "model/columns.h"

namespace tactus::explain
{

namespace
{

const size_t most_samples = 40000; /* of a series that are looked at; a longer one is thinned */

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

class Diagnosis
{
  public:
	Diagnosis(const tactus_table *const *tables, size_t count, const tactus_diagnose_options &o)
		: options(o), store(new Store)
	{
		for (size_t i = 0; i < count; i++)
			recordings.emplace_back(tables[i]);
	}
	int run();
	Store *release()
	{
		return store.release();
	}

  private:
	int split();
	int gate();
	void gather();
	void prepare(Work &work);
	void noise(Work &work, const VectorXd &y, const Hypothesis &h, bool candidates);
	void explain(Work &work);
	void hold_stated(Work &work, Hypothesis &base) const;
	std::vector<Extra> extras(const Work &work, const std::vector<size_t> &index) const;
	int extended();
	void summarise();

	const tactus_diagnose_options &options;
	std::vector<Recording> recordings;
	std::vector<Work> works;
	std::vector<std::vector<std::pair<size_t, size_t>>> members; /* per work: recording, series */
	std::map<int, std::vector<size_t>> wild; /* per channel: rows of readings that are left out from the start */
	std::map<int, const char *> hopeless;    /* per channel; 0: all */
	std::unique_ptr<Store> store;
};

int Diagnosis::split()
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

int Diagnosis::gate()
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
			store->problems.push_back({p.kind, store->text(p.text), k, p.channel, p.fatal,
									   store->keep(std::vector<size_t>(p.rows, p.rows + p.row_count)), p.row_count});
			if (p.fatal)
				hopeless[p.channel] = store->problems.back().text;
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
void Diagnosis::gather()
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
		std::sort(pairs.begin(), pairs.end());
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

std::vector<Extra> Diagnosis::extras(const Work &work, const std::vector<size_t> &index) const
{
	std::vector<Extra> result;
	const Recording &first = recordings[members[index[0]][0].first];
	const tactus_series &series = first.series[members[index[0]][0].second];
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
		for (const auto &[k, c] : members[index[0]]) {
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

void Diagnosis::prepare(Work &work)
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
		work.output_name[o] = first->output_name[o] ? first->output_name[o] : "";
		const size_t suffix = work.output_name[o].rfind('_');
		work.output_unit[o] = suffix == std::string::npos ? "" : work.output_name[o].substr(suffix + 1);
	}
	work.problem = std::make_unique<Problem>(segments, use);
	const auto fatal = hopeless.find(work.channel);
	work.hopeless = fatal != hopeless.end() ? fatal->second : hopeless.count(0) ? hopeless[0] : nullptr;
	if (!work.hopeless && work.problem->rows() < 20)
		work.hopeless = "fewer than 20 readings change with anything";
}

void Diagnosis::noise(Work &work, const VectorXd &y, const Hypothesis &h, bool candidates)
{
	Problem &problem = *work.problem;
	std::vector<VectorXd> columns;
	for (const Slot &slot : problem.slots(h)) {
		Hypothesis moved = h;
		Problem::value(moved, slot) += 1e-3 * slot.scale;
		VectorXd there;
		if (problem.simulate(moved, there) && (there - y).norm() > 0)
			columns.push_back(there - y);
	}
	for (size_t i = 0; candidates && problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		if (h.has(effect) || effect->testable(problem.segments.front()))
			continue;
		Grid grid = grid_of(problem, h, y, effect, 0, true, [](const VectorXd &column) { return column; });
		std::move(grid.columns.begin(), grid.columns.end(), std::back_inserter(columns));
	}
	for (const Group &group : work.evidence.groups)
		for (Index j = 0; j < group.columns.cols(); j++)
			columns.push_back(group.columns.col(j));
	VectorXd left;
	problem.noise = estimate_noise(problem, y, columns, left);
	if (!candidates)
		return;
	const std::vector<size_t> outliers = find_outliers(problem, left);
	if (!outliers.empty()) {
		work.outliers = outliers;
		problem.noise = estimate_noise(problem, y, columns, left);
		problem.count_training();
	}
}

/* A base parameter that the recording states is the model as given; an effect that does the same holds it there. */
void Diagnosis::hold_stated(Work &work, Hypothesis &base) const
{
	const tactus_domain *domain = work.problem->domain;
	for (size_t i = 0; i < domain->base_count; i++) {
		double stated;
		if (tactus_metadata_get_number(work.evidence.metadata, domain->base[i].name, &stated) != 1)
			continue;
		base.base[i] = stated;
		work.given = base;
		work.evidence.given = &work.given;
		for (size_t k = 0; domain->effects[k]; k++)
			if (domain->effects[k]->held_base == i + 1 && !domain->effects[k]->testable(work.problem->segments.front()))
				base.base_free.erase(std::remove(base.base_free.begin(), base.base_free.end(), i),
									 base.base_free.end());
	}
}

void Diagnosis::explain(Work &work)
{
	if (work.hopeless)
		return;
	Problem &problem = *work.problem;
	problem.make_blocks();
	Hypothesis base;
	for (size_t i = 0; i < problem.domain->base_count; i++) {
		const tactus_parameter &info = problem.domain->base[i];
		base.base.push_back(info.neutral != 0 ? info.neutral : problem.ranged(info, info.start));
		if (problem.acts(info))
			base.base_free.push_back(i);
	}
	work.evidence.problem = work.problem.get();
	work.evidence.metadata = tactus_table_metadata(recordings.front().table);
	work.evidence.given = nullptr;
	work.evidence.provenance = nullptr;
	const tactus_model_channel_data *given =
		options.model ? tactus_model_find_channel(options.model, work.channel) : nullptr;
	if (options.model && !given && options.model->channel_count == 1)
		given = &options.model->channels[0];
	if (given) {
		for (size_t i = 0; i < problem.domain->base_count; i++)
			if (std::isfinite(given->base[i]))
				base.base[i] = given->base[i];
		for (size_t k = 0; k < options.model->effect_count; k++) {
			Part part = problem.neutral(options.model->effects[k]);
			bool active = !tactus_effect_neutral(part.effect, given->effect[k]);
			for (size_t i = 0; i < part.value.size(); i++) {
				part.value[i] = given->effect[k][i];
				if (active && problem.acts(part.effect->parameters[i]) &&
					part.value[i] != part.effect->parameters[i].neutral)
					part.free.push_back(i);
			}
			if (active)
				base.parts.push_back(part);
		}
		work.given = base;
		work.evidence.given = &work.given;
		work.evidence.provenance = options.model->provenance;
	}
	if (!given)
		hold_stated(work, base);
	work.evidence.base = base;
	const Fit plain = problem.fit(base, Rows::all); /* by least squares, the noise not yet known */
	if (!plain.ok)
		return;
	VectorXd y;
	problem.simulate(plain.hypothesis, y);
	work.evidence.groups = groups_of(problem, extras(work, {size_t(&work - works.data())}), y, work.input_name);
	noise(work, y, plain.hypothesis, true);
	work.evidence.base = plain.hypothesis;
	work.decision = decide(work.evidence);
	const Decision &d = work.decision;
	if (!d.base.ok)
		return;
	const Fit &last = d.causes.empty() && d.stale ? d.moved.fit : d.final;
	Hypothesis h = last.hypothesis;
	problem.simulate(h, y);
	noise(work, y, h, false);
	work.full = problem.fit(h, Rows::all);
	if (!work.full.ok)
		work.full = problem.evaluate(h, Rows::all);
	const MatrixXd &j = work.full.jacobian;
	if (j.cols() == 0)
		return;
	MatrixXd masked = j;
	for (Index k = 0; k < j.cols(); k++) {
		VectorXd c = j.col(k);
		problem.mask(c, Rows::all);
		masked.col(k) = c;
	}
	VectorXd size = masked.colwise().norm();
	for (Index k = 0; k < size.size(); k++) {
		size[k] = size[k] > 0 ? size[k] : 1;
		masked.col(k) /= size[k];
	}
	const Eigen::CompleteOrthogonalDecomposition<MatrixXd> normal(masked.transpose() * masked);
	const MatrixXd covariance = normal.pseudoInverse();
	const double variance = work.full.square / std::fmax(double(problem.rows() - j.cols()), 1);
	const MatrixXd disagreement = covariance * problem.scatter(masked, work.full.residual) * covariance;
	for (Index k = 0; k < j.cols(); k++) {
		Hypothesis at = work.full.hypothesis;
		const Slot &slot = work.full.slots[size_t(k)];
		const double v = Problem::value(at, slot);
		const bool known = masked.col(k).norm() > 0 && v > slot.info->lower && v < slot.info->upper;
		const double square = std::fmax(covariance(k, k) * variance, disagreement(k, k));
		work.errors.push_back(known ? std::sqrt(std::fmax(square, 0)) / size[k] : NAN);
	}
}

/* The gravest verdict of the series is that of the whole. */
void Diagnosis::summarise()
{
	static const enum tactus_verdict order[] = {TACTUS_VERDICT_CAUSE_FOUND,   TACTUS_VERDICT_STALE_CALIBRATION,
												TACTUS_VERDICT_AMBIGUOUS,     TACTUS_VERDICT_UNEXPLAINED,
												TACTUS_VERDICT_NOTHING_WRONG, TACTUS_VERDICT_BAD_RECORDING};
	tactus_diagnosis &d = store->diagnosis;
	d.verdict = TACTUS_VERDICT_BAD_RECORDING;
	for (const enum tactus_verdict v : order)
		if (std::any_of(store->series.begin(), store->series.end(),
						[&](const tactus_diagnosed &s) { return s.verdict == v; })) {
			d.verdict = v;
			break;
		}
	const size_t n = store->series.size();
	if (n == 1) {
		d.summary = store->series[0].summary;
		return;
	}
	std::vector<std::pair<std::string, std::vector<int>>> said;
	for (const tactus_diagnosed &s : store->series) {
		std::string what = tactus_verdict_name(s.verdict);
		if (s.cause_count) {
			what.clear();
			for (size_t i = 0; i < s.cause_count; i++) {
				what += (i ? " and " : "") + std::string(s.causes[i].effect);
				for (size_t k = 0; k < s.causes[i].inseparable; k++)
					what += " or " + std::string(s.causes[i].rivals[k].effect);
			}
		}
		auto same = std::find_if(said.begin(), said.end(), [&](const auto &p) { return p.first == what; });
		if (same == said.end())
			said.push_back({what, {s.channel}});
		else
			same->second.push_back(s.channel);
	}
	std::stable_sort(said.begin(), said.end(),
					 [](const auto &a, const auto &b) { return a.second.size() > b.second.size(); });
	std::string text;
	for (const auto &[what, channels] : said) {
		text += text.empty() ? "" : "; ";
		if (channels.size() > 1 || n == 1)
			text += std::to_string(channels.size()) + " of " + std::to_string(n) + " sensors: " + what;
		else
			text += "sensor " + std::to_string(channels[0]) + ": " + what;
	}
	d.summary = store->text(text);
}

/* Every effect that some channel has, in the order of the chains. */
int Diagnosis::extended()
{
	std::vector<const tactus_effect *> effects;
	const Work *first = nullptr;
	for (const Work &work : works) {
		if (!work.full.ok)
			continue;
		first = first ? first : &work;
		for (const Part &part : work.full.hypothesis.parts)
			if (std::find(effects.begin(), effects.end(), part.effect) == effects.end()) {
				Hypothesis merged;
				for (const tactus_effect *e : effects) {
					merged.parts.emplace_back();
					merged.parts.back().effect = e;
				}
				merged.add(work.problem->domain, part);
				effects.clear();
				for (const Part &p : merged.parts)
					effects.push_back(p.effect);
			}
	}
	if (!first)
		return TACTUS_OK;
	tactus_model *model = tactus_model_new(first->problem->domain, TACTUS_FORM_FORWARD);
	if (!model)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	store->extended = model;
	for (const tactus_effect *effect : effects) {
		const int status = tactus_model_add_effect(model, effect);
		if (status != TACTUS_OK)
			return status;
	}
	for (const Work &work : works)
		if (work.full.ok)
			explain::extend(work, effects, model);
	tactus_metadata *to = model->provenance, *from = tactus_table_metadata(recordings.front().table);
	std::string files;
	for (const Recording &r : recordings) {
		const std::string path = tactus_table_file(r.table);
		files +=
			(files.empty() ? "" : ", ") + path.substr(path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1);
	}
	char date[32], print[17];
	const time_t now = time(nullptr);
	struct tm utc;
	strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&now, &utc));
	const char *start = tactus_metadata_get(from, "start");
	tactus_metadata_set(to, "model", "diagnose");
	tactus_metadata_set(to, "recording", files.c_str());
	tactus_metadata_set(to, "date", start ? start : date);
	tactus_metadata_set(to, "version", TACTUS_VERSION);
	tactus_metadata_set(to, "verdict", tactus_verdict_name(store->diagnosis.verdict));
	tactus_metadata_set(to, "finding", store->diagnosis.summary);
	if (options.model) {
		tactus_model_fingerprint(options.model, print);
		tactus_metadata_set(to, "extends", print);
	}
	for (const tactus_diagnosed &s : store->series)
		if (s.gain) {
			const std::string suffix = store->series.size() > 1 ? "_" + std::to_string(s.channel) : "";
			tactus_metadata_set_number(to, ("held_out_rmse_before" + suffix).c_str(), s.gain->rmse_before);
			tactus_metadata_set_number(to, ("held_out_rmse_after" + suffix).c_str(), s.gain->rmse_after);
		}
	return TACTUS_OK;
}

int Diagnosis::run()
{
	int status = split();
	if (status == TACTUS_OK)
		status = gate();
	if (status != TACTUS_OK)
		return status;
	gather();
	for (Work &work : works)
		prepare(work);
	struct Task {
		Diagnosis *self;
		std::vector<std::string> failed;
	} task = {this, std::vector<std::string>(works.size())};
	tactus_parallel(
		options.jobs > 0 ? options.jobs : 1, works.size(),
		[](void *context, size_t i) {
			auto *t = static_cast<Task *>(context);
			try {
				t->self->explain(t->self->works[i]);
			} catch (const std::exception &error) {
				t->failed[i] = error.what();
			}
		},
		&task);
	for (const std::string &failed : task.failed)
		if (!failed.empty())
			return tactus_fail(TACTUS_ERR_MEMORY, "the diagnosis failed: %s", failed.c_str());
	const char *device = options.device
							 ? options.device
							 : tactus_metadata_get(tactus_table_metadata(recordings.front().table), "device");
	for (Work &work : works) {
		if (!work.outliers.empty() || !wild[work.channel].empty()) {
			std::vector<size_t> rows = wild[work.channel];
			for (const size_t row : work.outliers)
				for (const Run &run : work.problem->runs)
					if (Index(row) >= run.first && Index(row) < run.first + run.count)
						rows.push_back(
							work.problem->segments[run.segment]->row[work.problem->sample[row] * work.every]);
			const size_t shown = std::min<size_t>(rows.size(), 100);
			store->problems.push_back(
				{"outliers",
				 store->format("%zu isolated wild reading%s of %s left out: more than eight times the noise off while "
							   "the readings beside "
							   "%s are not",
							   rows.size(), rows.size() == 1 ? " is" : "s are",
							   work.output_name[0].empty() ? work.output_name[1].c_str() : work.output_name[0].c_str(),
							   rows.size() == 1 ? "it" : "them"),
				 0, work.channel, false, store->keep(std::vector<size_t>(rows.begin(), rows.begin() + long(shown))),
				 shown});
		}
		store->series.push_back(report(*store, work, device ? device : "sim:", options.seed ? options.seed : 1));
	}
	summarise();
	status = extended();
	if (status != TACTUS_OK)
		return status;
	tactus_diagnosis &d = store->diagnosis;
	for (const Recording &r : recordings)
		store->recordings.push_back(store->text(tactus_table_file(r.table)));
	d.recordings = store->recordings.data();
	d.recording_count = store->recordings.size();
	d.domain = recordings.front().series->domain->name;
	d.problems = store->problems.data();
	d.problem_count = store->problems.size();
	d.series = store->series.data();
	d.series_count = store->series.size();
	d.extended = store->extended;
	return TACTUS_OK;
}

} // namespace

} // namespace tactus::explain

extern "C" const char *tactus_verdict_name(enum tactus_verdict verdict)
{
	static const char *const names[] = {"cause-found", "nothing-wrong",     "unexplained",
										"ambiguous",   "stale-calibration", "bad-recording"};
	return names[verdict];
}

extern "C" int tactus_diagnose(const tactus_table *const *recordings, size_t count,
							   const tactus_diagnose_options *options, const tactus_diagnosis **diagnosis)
{
	static const tactus_diagnose_options defaults = {};
	const tactus_diagnose_options &o = options ? *options : defaults;
	if (count == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "no recording to diagnose");
	if (o.model && tactus_model_form(o.model) != TACTUS_FORM_FORWARD)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"the model is an estimator (%s): it goes from readings to force and cannot be simulated; give "
			"a forward model",
			tactus_form_name(tactus_model_form(o.model)));
	try {
		tactus::explain::Diagnosis work(recordings, count, o);
		const int status = work.run();
		if (status == TACTUS_OK)
			*diagnosis = &work.release()->diagnosis;
		return status;
	} catch (const std::bad_alloc &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_MEMORY, "the diagnosis failed: %s", error.what());
	}
}

extern "C" void tactus_diagnosis_free(const tactus_diagnosis *diagnosis)
{
	/* The diagnosis is the first member of what owns it. */
	delete reinterpret_cast<tactus::explain::Store *>(const_cast<tactus_diagnosis *>(diagnosis));
}
