/* From a decision to what the caller reads: sentences, gains, the extended model, arrays for pictures. */
#ifndef TACTUS_DIAGNOSE_REPORT_HPP
#define TACTUS_DIAGNOSE_REPORT_HPP

#include <tactus/diagnose.h>

#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "diagnose/decide.hpp"

namespace tactus::explain
{

/* Owns everything that a tactus_diagnosis points to. */
struct Store {
	tactus_diagnosis diagnosis{};
	std::deque<std::string> texts;
	std::deque<std::shared_ptr<void>> arrays;
	std::vector<tactus_problem> problems;
	std::vector<tactus_diagnosed> series;
	std::vector<const char *> recordings;
	tactus_model *extended = nullptr;

	~Store();
	const char *text(const std::string &s);
	const char *format(const char *format, ...) TACTUS_PRINTF(2, 3);
	template <typename T> const T *keep(std::vector<T> values)
	{
		if (values.empty())
			return nullptr;
		auto kept = std::make_shared<std::vector<T>>(std::move(values));
		arrays.push_back(kept);
		return kept->data();
	}
};

/* One series on its way through. */
struct Work {
	/* A press can follow a protocol, and the live inverse gives newtons: not where another column plays the load. */
	bool pressed() const
	{
		const size_t n = input_name.size();
		return problem->domain->loaded && n > 2 && input_name.compare(n - 2, 2, "_N") == 0;
	}
	bool newtons() const
	{
		return pressed() && problem->input_range > 0;
	}

	/* 0 where the whole recording is one series. */
	int said_channel() const
	{
		return problem->domain->by_channel ? channel : 0;
	}

	int channel = 0;                    /* in models: 1 where the whole recording is one series */
	std::vector<tactus_series> thinned; /* own copies where the recording is longer than is looked at */
	std::vector<std::vector<double>> buffers;
	std::vector<const double *>
		sequence; /* per segment: the recording's scans by row, NULL if it does not number them */
	std::unique_ptr<Problem> problem;
	Evidence evidence;
	Hypothesis given;
	bool has_given = false;
	size_t every = 1;
	std::vector<size_t> outliers;   /* rows of the problem */
	const char *hopeless = nullptr; /* why nothing can be said */
	Decision decision;
	Fit full;                   /* the last model, fitted to all rows */
	std::vector<double> errors; /* standard errors of its slots */
	std::string input_name, output_name[TACTUS_OUTPUTS_MAX], output_unit[TACTUS_OUTPUTS_MAX];
};

/* Units of a parameter here: "output0/N" is S/N. */
std::string unit_of(const Work &work, const char *unit);
/* Three significant digits with an SI prefix: "12.4 nS". */
std::string quantity(double value, const std::string &unit);

const tactus_dependence *describe(Store &store, const Work &work, const std::vector<Dependence> &list, const Fit &fit);
const char *swing_in_words(Store &store, const Work &work, const Swing &swing);
/* Root mean square of a stack over an output's readings that are no outliers. */
double rms_of(const Problem &problem, size_t output, const VectorXd &x);
/* How far the model as given (refitted, where none is) is off in newtons, on held-out data; NaN: no force. */
double force_error_N(const Work &work);
const tactus_gain *measure_gain(Store &store, const Work &work, uint64_t seed, std::vector<double> *per_cause,
								std::vector<double> *per_cause_low, std::vector<double> *per_cause_high);
/* device: NULL where it is not known whose recording this is. */
const tactus_experiment *propose(Store &store, const Work &work, const char *device);
/* The channel's parameters in a model that holds every effect of `effects` in that order. */
void extend(const Work &work, const std::vector<const tactus_effect *> &effects, tactus_model *model);
/* A model of one channel with the parameters of a hypothesis, for the live inverse. NULL when memory runs out. */
tactus_model *model_of(const Work &work, const Hypothesis &h, const Noise &noise);
/* Everything about a series. */
tactus_diagnosed report(Store &store, const Work &work, const char *device, uint64_t seed);

} // namespace tactus::explain

#endif
