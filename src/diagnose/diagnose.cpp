/* Recordings in, a diagnosis out: gathered, explained series by series, put together. */
#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/core.h"
#include "device/uri.h"
#include "diagnose/gather.hpp"
#include "diagnose/limits.hpp"
#include "diagnose/noise.hpp"
#include "fit/fit_work.h"
#include "model/provenance.h"

namespace tactus::explain
{

namespace
{

class Diagnosis
{
  public:
	Diagnosis(const tactus_table *const *tables, size_t count, const tactus_diagnose_options &o)
		: options(o), gathered(tables, count, o), store(new Store)
	{
	}
	int run();
	Store *release()
	{
		return store.release();
	}

  private:
	void judge(Work &work, Saturated &saturated, const Hypothesis &h, const VectorXd &y);
	void explain(Work &work);
	void hold_stated(Work &work, Hypothesis &base) const;
	int extended();
	void summarise();
	const char *scanned() const;

	const tactus_diagnose_options &options;
	Gathered gathered;
	const std::vector<Recording> &recordings = gathered.recordings;
	std::vector<Work> &works = gathered.works;
	std::unique_ptr<Store> store;
};

/* What the model says changes by along each of its parameters. */
std::vector<VectorXd> own_columns(const Problem &problem, const Hypothesis &h, const VectorXd &y)
{
	std::vector<VectorXd> columns;
	for (const Slot &slot : problem.slots(h)) {
		Hypothesis moved = h;
		Problem::value(moved, slot) += 1e-3 * slot.scale;
		VectorXd there;
		if (problem.simulate(moved, there) && (there - y).norm() > 0)
			columns.push_back(there - y);
	}
	return columns;
}

/* And along those of every candidate. */
std::vector<Column> candidate_columns(const Around &around)
{
	std::vector<Column> columns;
	for (size_t i = 0; around.problem.domain->effects[i]; i++) {
		const tactus_effect *effect = around.problem.domain->effects[i];
		if (around.hypothesis.has(effect) || around.problem.untestable(effect))
			continue;
		const Grid grid = grid_of(around, effect, 0, true, [](const Column &column) { return column; });
		columns.insert(columns.end(), grid.columns.begin(), grid.columns.end());
	}
	return columns;
}

Saturated::Columns seen(const std::vector<Column> &candidates, const std::vector<Group> &groups)
{
	Saturated::Columns columns;
	for (const Column &column : candidates)
		columns.emplace_back(column->data(), column->size());
	for (const Group &group : groups)
		for (Index j = 0; j < group.columns.cols(); j++)
			columns.emplace_back(group.columns.col(j).data(), group.columns.rows());
	return columns;
}

/* The noise as it is if h says all that can be said, y being what h says; wild readings are left out. */
void Diagnosis::judge(Work &work, Saturated &saturated, const Hypothesis &h, const VectorXd &y)
{
	Problem &problem = *work.problem;
	const std::vector<VectorXd> own = own_columns(problem, h, y);
	VectorXd left;
	problem.noise = saturated.judge(y, own, left);
	const std::vector<size_t> outliers = find_outliers(problem, left);
	if (outliers.empty())
		return;
	work.outliers.insert(work.outliers.end(), outliers.begin(), outliers.end());
	saturated.forget();
	problem.noise = saturated.judge(y, own, left);
	problem.count_training();
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
			if (domain->effects[k]->held_base == i + 1 && !work.problem->untestable(domain->effects[k]))
				base.base_free.erase(std::remove(base.base_free.begin(), base.base_free.end(), i),
									 base.base_free.end());
	}
}

namespace
{

/* Standard errors of a fit's parameters; NaN where one stands at a bound or moves nothing. */
std::vector<double> standard_errors(const Problem &problem, const Fit &fit)
{
	const MatrixXd &j = fit.jacobian;
	std::vector<double> errors;
	if (j.cols() == 0)
		return errors;
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
	const double variance = fit.square / std::fmax(double(problem.rows() - j.cols()), 1);
	const MatrixXd disagreement = covariance * problem.scatter(masked, fit.residual) * covariance;
	for (Index k = 0; k < j.cols(); k++) {
		Hypothesis at = fit.hypothesis;
		const Slot &slot = fit.slots[size_t(k)];
		const double v = Problem::value(at, slot);
		const bool known = masked.col(k).norm() > 0 && v > slot.info->lower && v < slot.info->upper;
		const double square = std::fmax(covariance(k, k) * variance, disagreement(k, k));
		errors.push_back(known ? std::sqrt(std::fmax(square, 0)) / size[k] : NAN);
	}
	return errors;
}

/* Takes out what a memory began with where it is no larger than its error; true if there was any. */
bool drop_undetermined(const Fit &fit, const std::vector<double> &errors, Hypothesis &h)
{
	bool any = false;
	for (size_t k = 0; k < fit.slots.size(); k++) {
		const Slot &slot = fit.slots[k];
		if (slot.part < 0 || slot.info->kind != TACTUS_INITIAL ||
			std::abs(Problem::value(h, slot) - slot.info->neutral) > errors[k])
			continue;
		Part &part = h.parts[size_t(slot.part)];
		part.value[slot.index] = slot.info->neutral;
		part.free.erase(std::remove(part.free.begin(), part.free.end(), slot.index), part.free.end());
		any = true;
	}
	return any;
}

} // namespace

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
			if (tactus_model_has(options.model, &problem.domain->base[i]))
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
	/* What a model does not predict (fitted to conductance alone) it cannot be wrong about: only causes show there. */
	for (size_t i = 0; given && i < problem.domain->base_count; i++)
		if (!tactus_model_has(options.model, &problem.domain->base[i])) {
			work.given.base[i] = plain.hypothesis.base[i];
			work.given.base_free.erase(std::remove(work.given.base_free.begin(), work.given.base_free.end(), i),
									   work.given.base_free.end());
		}
	VectorXd y;
	problem.simulate(plain.hypothesis, y);
	problem.estimate_blur(y);
	work.evidence.groups = groups_of(problem, gathered.extras(work), y, work.input_name);
	work.evidence.base = plain.hypothesis;
	{
		const Around around(problem, plain.hypothesis);
		const std::vector<Column> candidates = candidate_columns(around);
		Saturated saturated(problem, seen(candidates, work.evidence.groups));
		judge(work, saturated, plain.hypothesis, y);
		/* What a large cause left unlike its form had passed for noise: with the cause there it may be much less. */
		work.decision = decide(work.evidence, around, [&](const Hypothesis &found) {
			const Noise before = problem.noise;
			const size_t wild = work.outliers.size();
			problem.simulate(found, y);
			judge(work, saturated, found, y);
			bool less = false;
			for (size_t o = 0; o < problem.output_count; o++)
				less = less || problem.noise.sigma[o] < limits.less_noise * before.sigma[o];
			if (!less)
				problem.noise = before;
			return less || work.outliers.size() > wild; /* fewer rows: what was gathered of them no longer fits */
		});
	}
	const Decision &d = work.decision;
	if (!d.base.ok)
		return;
	const Fit &last = d.causes.empty() && d.stale ? d.moved.fit : d.final;
	Hypothesis h = last.hypothesis;
	problem.simulate(h, y);
	VectorXd left;
	problem.noise = Saturated(problem, seen({}, work.evidence.groups)).judge(y, own_columns(problem, h, y), left);
	work.full = problem.fit(h, Rows::all);
	if (!work.full.ok)
		work.full = problem.evaluate(h, Rows::all);
	work.full.hypothesis = problem.levelled(work.full.hypothesis, Rows::all);
	work.errors = standard_errors(problem, work.full);
	/* Where the order of the memory's past cannot be read off, it is neutral: numbers without a meaning are none. */
	h = work.full.hypothesis;
	if (drop_undetermined(work.full, work.errors, h)) {
		const Fit fit = problem.fit(h, Rows::all);
		if (fit.ok) {
			work.full = fit;
			work.full.hypothesis = problem.levelled(fit.hypothesis, Rows::all);
			work.errors = standard_errors(problem, work.full);
		}
	}
	/* An autoregression takes a swing for noise, and of what stands at the edge of a line it makes any size. */
	for (size_t o = 0; o < problem.output_count; o++)
		if (d.swing.floor[o] > 0)
			problem.noise.spread[o] = d.swing.floor[o];
}

namespace
{

constexpr size_t HEADLINE = 155; /* bytes: two lines of a terminal */

using Shared = std::vector<std::pair<std::string, std::vector<int>>>; /* what is said, and of which channels */

void add_channel(Shared &said, const std::string &what, int channel)
{
	auto same = std::find_if(said.begin(), said.end(), [&](const auto &p) { return p.first == what; });
	if (same == said.end())
		said.push_back({what, {channel}});
	else
		same->second.push_back(channel);
}

/* The causes of a channel, or its verdict where it has none; in short, a crowd of rivals is counted. */
std::vector<std::string> causes_in_words(const tactus_diagnosed &s, bool in_short)
{
	std::vector<std::string> words;
	for (size_t i = 0; i < s.cause_count; i++) {
		const tactus_cause &cause = s.causes[i];
		std::string what = cause.effect;
		if (in_short && cause.inseparable > 1)
			what += " or " + std::to_string(cause.inseparable) + " others";
		else
			for (size_t k = 0; k < cause.inseparable; k++)
				what += " or " + std::string(cause.rivals[k].effect);
		words.push_back(what);
	}
	if (words.empty())
		words.push_back(tactus_verdict_name(s.verdict));
	return words;
}

/* What most channels share comes first; what is past the length of a headline stands with the channels. */
std::string shared_in_words(Shared said, size_t n, bool cut)
{
	static const char more[] = "; and more";
	std::stable_sort(said.begin(), said.end(),
					 [](const auto &a, const auto &b) { return a.second.size() > b.second.size(); });
	std::string text;
	for (const auto &[what, channels] : said) {
		std::string part = text.empty() ? "" : "; ";
		if (channels.size() > 1)
			part += std::to_string(channels.size()) + " of " + std::to_string(n) +
					(cut && !text.empty() ? ": " : " sensors: ") + what;
		else
			part += "sensor " + std::to_string(channels[0]) + ": " + what;
		if (cut && !text.empty() && text.size() + part.size() + sizeof more > HEADLINE)
			return text + more;
		text += part;
	}
	return text;
}

} // namespace

/* The gravest verdict of the series is that of the whole; nothing is wrong only where every series could be judged. */
void Diagnosis::summarise()
{
	static const enum tactus_verdict order[] = {TACTUS_VERDICT_CAUSE_FOUND,   TACTUS_VERDICT_STALE_CALIBRATION,
												TACTUS_VERDICT_AMBIGUOUS,     TACTUS_VERDICT_UNEXPLAINED,
												TACTUS_VERDICT_BAD_RECORDING, TACTUS_VERDICT_NOTHING_WRONG};
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
	Shared whole, parts;
	for (const tactus_diagnosed &s : store->series) {
		std::string what;
		for (const std::string &cause : causes_in_words(s, false))
			what += (what.empty() ? "" : " and ") + cause;
		add_channel(whole, what, s.channel);
		for (const std::string &cause : causes_in_words(s, true))
			add_channel(parts, cause, s.channel);
	}
	const std::string text = shared_in_words(whole, n, false);
	d.summary = store->text(text.size() <= HEADLINE ? text : shared_in_words(parts, n, true));
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
	std::string files;
	std::vector<tactus_series> all; /* views: what was recorded in all of them */
	for (const Recording &r : recordings) {
		const std::string path = tactus_table_file(r.table);
		files +=
			(files.empty() ? "" : ", ") + path.substr(path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1);
		all.insert(all.end(), r.series, r.series + r.count);
	}
	const int status = tactus_note_provenance(recordings.front().table, all.data(), all.size(), "diagnose", model);
	if (status != TACTUS_OK)
		return status;
	tactus_metadata *to = model->provenance;
	char print[17];
	tactus_metadata_set(to, "recording", files.c_str());
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
			for (size_t c = 0; c < model->channel_count; c++)
				if (model->channels[c].channel == (s.channel ? s.channel : 1))
					model->channels[c].cv_rmse_N = s.gain->force_rmse_after_N; /* of blocks that no choice has seen */
		}
	return TACTUS_OK;
}

/* The URI that the next experiment is written for: as asked, else that of the recording if a scan would take it; NULL.
 */
const char *Diagnosis::scanned() const
{
	const tactus_metadata *metadata = tactus_table_metadata(recordings.front().table);
	if (options.device)
		return options.device;
	for (const char *key : {"uri", "device"})
		if (const char *uri = tactus_metadata_get(metadata, key); uri && tactus_device_accepts(uri))
			return uri;
	return nullptr;
}

int Diagnosis::run()
{
	int status = gathered.run(*store);
	if (status != TACTUS_OK)
		return status;
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
	const char *device = scanned();
	for (Work &work : works) {
		if (!work.outliers.empty() || !gathered.wild[work.channel].empty()) {
			std::vector<size_t> rows = gathered.wild[work.channel];
			for (const size_t row : work.outliers)
				for (const Run &run : work.problem->runs)
					if (Index(row) >= run.first && Index(row) < run.first + run.count)
						rows.push_back(
							work.problem->segments[run.segment]->row[work.problem->sample[row] * work.every]);
			const size_t shown = std::min<size_t>(rows.size(), 100);
			store->problems.push_back(
				{"outliers",
				 store->format(
					 "%zu isolated wild reading%s of %s %s left out: more than eight times the noise off while "
					 "the readings beside %s are not",
					 rows.size(), rows.size() == 1 ? "" : "s",
					 work.output_name[0].empty() ? work.output_name[1].c_str() : work.output_name[0].c_str(),
					 rows.size() == 1 ? "is" : "are", rows.size() == 1 ? "it" : "them"),
				 0, work.said_channel(), false,
				 store->keep(std::vector<size_t>(rows.begin(), rows.begin() + long(shown))), shown});
		}
		store->series.push_back(report(*store, work, device, options.seed ? options.seed : 1));
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
