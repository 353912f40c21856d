/* The next experiment: of a menu of protocols, the one on which the rivals' simulations differ most. */
#include <algorithm>
#include <cmath>
#include <cstring>

#include <tactus/device.h>

#include "core/core.h"
#include "diagnose/limits.hpp"
#include "diagnose/report.hpp"

namespace tactus::explain
{

namespace
{

/* L and H are the lowest and highest load of the recording, M half of H, X three times H; %g takes newtons. */
struct Item {
	const char *steps;                    /* letters in braces are loads */
	double rate_Hz;                       /* at least */
	const char *what, *because, *between; /* the reason, and the effects that it is one for */
};

const Item menu[] = {
	{"repeat 3 (rest 40s, hold {H} 60s), rest 120s", 10, "a load, a rest and the load again",
	 "what recovers is no drift", "creep drift step-change temperature"},
	{"repeat 10 (tap {H} 200ms, rest 1s)", 500, "taps, sampled fast",
	 "a late reading keeps their shape, a lag does not", "lag time-offset"},
	{"sine 0.2Hz {L}..{H} 40s, sine 2Hz {L}..{H} 10s, sine 0.2Hz {L}..{M} 40s, sine 2Hz {L}..{M} 10s", 50,
	 "two rates and two amplitudes", "friction knows no rate, a lag no amplitude", "hysteresis lag creep time-offset"},
	{"cycle 0.5Hz {L}..{H} 120s, hold {H} 120s, cycle 0.5Hz {L}..{H} 120s, rest 60s", 10, "cycling against holding",
	 "only the one wears", "cyclic-decline linear-decline creep drift"},
	{"cycle 0.5Hz {L}..{H} 900s", 5, "cycling for long", "an exponential ends, a line does not",
	 "cyclic-decline linear-decline"},
	{"staircase 0N..{X}..0N {M} 4s", 10, "loads far past those of this recording",
	 "an asymptote shows, a power goes on", "saturation nonlinearity"},
	{"ramp 0N..{H} 20s, ramp {H}..0N 20s, staircase 0N..{M}..0N {S} 2s", 20, "small loads as well as large ones", "",
	 ""},
	{"random 0N..{H} 2s 120s", 20, "loads in no order, so that nothing goes with time", "", ""},
};

/* In words; the reason only where it is one for this pair. */
std::string words_of(const Item &item, const std::string &a, const std::string &b)
{
	const std::string between = std::string(" ") + item.between + " ";
	const bool apt =
		between.find(" " + a + " ") != std::string::npos && between.find(" " + b + " ") != std::string::npos;
	return std::string(item.what) + (apt ? std::string(": ") + item.because : "");
}

std::string steps_of(const Item &item, double low, double high)
{
	std::string text = item.steps;
	const std::pair<const char *, double> loads[] = {
		{"{L}", low}, {"{H}", high}, {"{M}", 0.5 * high}, {"{X}", 3 * high}, {"{S}", 0.05 * high}};
	for (const auto &[word, load] : loads)
		for (size_t at; (at = text.find(word)) != std::string::npos;) {
			char number[32];
			snprintf(number, sizeof number, "%.3gN", load);
			text.replace(at, strlen(word), number);
		}
	return text;
}

/* A series that a protocol would give: its loads over time, every covariate as it was. */
struct Synthetic {
	tactus_series series{};
	std::vector<std::vector<double>> columns;

	Synthetic(const tactus_series *like, const std::string &steps, double rate_Hz)
	{
		tactus_protocol *protocol = nullptr;
		if (tactus_protocol_parse(steps.c_str(), 1, &protocol) != TACTUS_OK)
			return;
		series.domain = like->domain;
		series.channel = like->channel;
		series.n = size_t(std::ceil(tactus_protocol_duration_s(protocol) * rate_Hz));
		series.dt = 1 / rate_Hz;
		series.has_clock = series.has_order = true;
		series.input_name = like->input_name;
		std::copy_n(like->output_name, TACTUS_OUTPUTS_MAX, series.output_name);
		for (size_t s = 0; s < like->domain->signal_count; s++) {
			const enum tactus_role role = like->domain->signals[s].role;
			if (role == TACTUS_ROLE_INTERNAL ||
				(role != TACTUS_ROLE_TIME && role != TACTUS_ROLE_INPUT && !like->signal[s]))
				continue;
			std::vector<double> column(series.n, role == TACTUS_ROLE_OUTPUT ? 0 : typical(like, s));
			for (size_t i = 0; i < series.n; i++) {
				const double t = double(i) / rate_Hz;
				if (role == TACTUS_ROLE_TIME)
					column[i] = t;
				else if (role == TACTUS_ROLE_INPUT || role == TACTUS_ROLE_NEIGHBOUR)
					column[i] = tactus_protocol_force_N(protocol, t);
			}
			columns.push_back(std::move(column));
			series.recorded[s] = true;
		}
		size_t next = 0;
		for (size_t s = 0; s < like->domain->signal_count; s++)
			if (series.recorded[s])
				series.signal[s] = columns[next++].data();
		tactus_protocol_free(protocol);
	}
	static double typical(const tactus_series *like, size_t s)
	{
		std::vector<double> values;
		for (size_t i = 0; like->signal[s] && i < like->n; i++)
			if (std::isfinite(like->signal[s][i]))
				values.push_back(like->signal[s][i]);
		if (values.empty())
			return like->domain->signals[s].fill;
		std::nth_element(values.begin(), values.begin() + long(values.size() / 2), values.end());
		return values[values.size() / 2];
	}
};

/* Evidence against b that a recording of this protocol gives if a is true: n log(1 + squares that b leaves / n). */
double evidence_of(const Work &work, Synthetic &s, const Hypothesis &a, const Hypothesis &b)
{
	const Problem &from = *work.problem;
	std::vector<std::vector<char>> use(from.output_count, std::vector<char>(s.series.n, 0));
	size_t o = 0;
	for (size_t k = 0; k < s.series.domain->signal_count; k++) {
		if (s.series.domain->signals[k].role != TACTUS_ROLE_OUTPUT)
			continue;
		if (from.outputs[o] && s.series.signal[k])
			for (size_t i = 0; i < s.series.n; i++) {
				use[o][i] = 1;
				s.series.signal[k][i] = double(i % 2); /* any values: the simulation replaces them */
			}
		o++;
	}
	Problem problem({&s.series}, {use});
	VectorXd y;
	if (!problem.simulate(a, y))
		return 0;
	for (const Run &run : problem.runs) {
		const double sigma = from.noise.spread[run.output] * from.scale[run.output] / problem.scale[run.output];
		problem.noise.sigma[run.output] = sigma;
	}
	problem.measured = y;
	problem.input_range = from.input_range; /* constants are stated for the ranges of the recording */
	std::copy_n(from.range, TACTUS_OUTPUTS_MAX, problem.range);
	problem.training = problem.rows();
	const Fit fit = problem.fit(b, Rows::all);
	const double n = double(problem.rows());
	return fit.ok ? n * std::log1p(fit.square / n) : 0;
}

std::string scan_command(const Work &work, const char *device, const std::string &rest)
{
	std::string command = "tactus scan ";
	const std::string uri = device ? device : "sim:"; /* a command that can be pasted, whatever made the recording */
	command += uri.find_first_of(" \t\"'") == std::string::npos ? uri : "'" + uri + "'";
	if (work.said_channel() > 0)
		command += " --channels " + std::to_string(work.channel);
	return command + " " + rest + " -o next.csv";
}

/* As it was recorded: in one mode, where the recording says that it was one. */
std::string modes_of(const Work &work)
{
	const char *modes = work.evidence.metadata ? tactus_metadata_get(work.evidence.metadata, "modes") : nullptr;
	return modes && (strcmp(modes, "dc") == 0 || strcmp(modes, "ac") == 0) ? std::string("--mode ") + modes + " " : "";
}

std::string command_of(const Work &work, const char *device, const std::string &steps, double rate_Hz)
{
	char rate[48];
	snprintf(rate, sizeof rate, "--rate %gHz", rate_Hz);
	return scan_command(work, device, modes_of(work) + "--protocol \"" + steps + "\" " + rate);
}

/* A scan refuses a rate that leaves its readings no time to settle; the recording says how long its own took. */
double possible_Hz(const Work &work, double wanted_Hz)
{
	double settle_s, own_Hz;
	const tactus_metadata *m = work.evidence.metadata;
	if (!m || tactus_metadata_get_number(m, "settle_s", &settle_s) != 1)
		return wanted_Hz;
	const double reading_s = settle_s + 2e-3, /* and some for the reading itself */
		modes = modes_of(work).empty() ? 2 : 1;
	double most_Hz = std::floor(1 / (modes * reading_s));
	if (tactus_metadata_get_number(m, "rate_requested_Hz", &own_Hz) == 1)
		most_Hz = std::fmax(most_Hz, own_Hz);
	return std::fmin(wanted_Hz, most_Hz);
}

struct Choice {
	const Item *item = nullptr;
	std::string steps;
	double rate_Hz = 0, evidence = 0;
	size_t testable = 0;
};

class Menu
{
  public:
	explicit Menu(const Work &w) : work(w), series(w.problem->segments.front())
	{
		high = tactus_series_maximum(series, int(work.problem->input_signal()));
		low = std::fmax(tactus_series_minimum(series, int(work.problem->input_signal())), 0.05 * high);
	}
	template <typename Score> Choice best(Score score) const
	{
		Choice choice;
		for (const Item &item : menu) {
			const std::string steps = steps_of(item, low, high);
			const double rate = possible_Hz(work, item.rate_Hz);
			Synthetic synthetic(series, steps, rate);
			if (synthetic.series.n < 2)
				continue;
			const double value = score(synthetic);
			if (value > choice.evidence)
				choice = {&item, steps, rate, value, 0};
		}
		return choice;
	}

  private:
	const Work &work;
	const tactus_series *series;
	double low, high;
};

std::string text_of(const tactus_effect *effect)
{
	return *effect->confused_with ? std::string(effect->name) + " is confused with " + effect->confused_with
								  : std::string(effect->name) + " needs " + effect->needs;
}

const tactus_experiment *made(Store &store, const char *device, const std::vector<std::string> &names,
							  const std::string &command, const std::string &text, double evidence)
{
	std::vector<const char *> list;
	list.reserve(names.size());
	for (const std::string &name : names)
		list.push_back(store.text(name));
	tactus_experiment e{};
	e.separates_count = list.size();
	e.separates = store.keep(std::move(list));
	e.command = store.text(command);
	e.text =
		store.text(device ? text : text + " (with your own device in place of the simulated one: `tactus devices`)");
	e.expected_delta_bic = evidence;
	return store.keep(std::vector<tactus_experiment>{e});
}

/* Where another column plays the load nothing here can move it: in words, at the same pace. */
std::string by_hand(const Work &work)
{
	const tactus_series *series = work.problem->segments.front();
	const int input = int(work.problem->input_signal());
	const size_t suffix = work.input_name.rfind('_');
	const std::string unit = suffix == std::string::npos ? "" : work.input_name.substr(suffix + 1);
	if (work.pressed() || !work.problem->domain->loaded)
		return "";
	return "; meanwhile move " + work.input_name + " from " + quantity(tactus_series_minimum(series, input), unit) +
		   " to " + quantity(tactus_series_maximum(series, input), unit) + " and back, twice, 20 s each way";
}

/* What can only be told by varying something that no load protocol moves. */
std::string by_covariate(const Work &work, const char *device, const tactus_effect *effect)
{
	const std::string covariate = effect ? effect->covariate : "";
	const double high = tactus_series_maximum(work.problem->segments.front(), int(work.problem->input_signal()));
	const std::string loads = steps_of({"repeat 2 (ramp 0N..{H} 20s, ramp {H}..0N 20s)", 10, "", "", ""}, 0, high);
	if (!work.problem->domain->loaded)
		return scan_command(work, device, "--loads standard --mode dc,ac");
	std::string command =
		work.pressed() ? command_of(work, device, loads, 10) : scan_command(work, device, "--rate 10Hz --duration 80s");
	if (covariate == "drive_V") {
		std::string second = command;
		second.replace(second.find(" -o next.csv"), 12, " --drive 1V --append -o next.csv");
		return command + " && " + second;
	}
	return command;
}

/* Which effects a protocol would make testable: tried with the effects' own conditions. */
const tactus_experiment *to_test_more(Store &store, const Work &work, const char *device)
{
	const Decision &d = work.decision;
	if (!work.newtons())
		return nullptr;
	std::vector<std::string> names;
	auto newly = [&](const Synthetic &s) {
		std::vector<std::string> list;
		for (size_t i = 0; i < d.why.size(); i++) {
			const tactus_effect *effect = work.problem->domain->effects[i];
			if (d.why[i] && (effect->flags & TACTUS_EFFECT_NEIGHBOURS) == 0 && !effect->testable(&s.series))
				list.push_back(effect->name);
		}
		return list;
	};
	const Choice choice = Menu(work).best([&](Synthetic &s) { return double(newly(s).size()); });
	if (!choice.item)
		return nullptr;
	Synthetic synthetic(work.problem->segments.front(), choice.steps, choice.rate_Hz);
	names = newly(synthetic);
	std::string text = "this recording could not test ";
	for (size_t i = 0; i < names.size(); i++)
		text += (i ? ", " : "") + names[i];
	return made(store, device, names, command_of(work, device, choice.steps, choice.rate_Hz),
				text + "; this one can: " + choice.item->what, NAN);
}

} // namespace

const tactus_experiment *propose(Store &store, const Work &work, const char *device)
{
	const Decision &d = work.decision;
	if (d.verdict != TACTUS_VERDICT_AMBIGUOUS)
		return d.verdict == TACTUS_VERDICT_CAUSE_FOUND ? nullptr : to_test_more(store, work, device);
	const bool stale = d.causes.empty();
	const std::vector<Rival> &rivals = stale ? d.moved.rivals : d.causes.front().rivals;
	const Hypothesis &ours = stale ? d.moved.fit.hypothesis : d.final.hypothesis;
	std::vector<std::string> names = {stale ? "stale-calibration" : d.causes.front().effect->name};
	const Rival *first = nullptr;
	for (const Rival &r : rivals)
		if (r.inseparable) {
			names.push_back(r.name);
			first = first || !r.effect ? first : &r;
		}
	const tactus_effect *effect = stale ? nullptr : d.causes.front().effect;
	if (first && work.newtons() && (first->effect->flags & TACTUS_EFFECT_NEIGHBOURS) == 0) { /* one load for all */
		const Choice choice =
			Menu(work).best([&](Synthetic &s) { return evidence_of(work, s, ours, first->hypothesis); });
		if (choice.item && choice.evidence > limits.margin) {
			char expected[96];
			snprintf(expected, sizeof expected, "; expected evidence between %s and %s: ΔBIC −%.0f", names[0].c_str(),
					 first->name.c_str(), choice.evidence);
			return made(store, device, names, command_of(work, device, choice.steps, choice.rate_Hz),
						words_of(*choice.item, names[0], first->name) + expected, choice.evidence);
		}
	}
	if (first)
		return made(store, device, names, by_covariate(work, device, first->effect),
					text_of(first->effect) + by_hand(work), NAN);
	const std::string apart = effect && effect->twin_separated_by ? effect->twin_separated_by
							  : d.moved.separated_by              ? d.moved.separated_by
																  : "another experiment";
	std::string command = by_covariate(work, device, effect);
	if (work.problem->domain->loaded)
		command = scan_command(work, device, "--loads standard --mode dc,ac");
	return made(store, device, names, command, "what tells them apart: " + apart, NAN);
}

} // namespace tactus::explain
