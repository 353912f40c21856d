/*
 * What a diagnosis works on: the readings of one series over all recordings, hypotheses (base and effects with their
 * parameters), and their fits. It sees a domain, a catalogue and a recording; it knows no effect by name.
 */
#ifndef TACTUS_DIAGNOSE_PROBLEM_HPP
#define TACTUS_DIAGNOSE_PROBLEM_HPP

#include <Eigen/Dense>
#include <memory>
#include <string>
#include <vector>

#include "model/model.h"
#include "model/series.h"

namespace tactus::explain
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/* A run of readings of one output in one recording, in time order: rows [first, first + count) of every stack. */
struct Run {
	size_t output, segment;
	Index first, count;
};

/* An effect in a hypothesis: all its parameters, and which of them are fitted. */
struct Part {
	const tactus_effect *effect = nullptr;
	std::vector<double> value;
	std::vector<size_t> free;
};

/* A model of the series. Parts are in the order of their stages, within a stage in that of the catalogue. */
struct Hypothesis {
	std::vector<double> base;
	std::vector<size_t> base_free;
	std::vector<Part> parts;

	bool has(const tactus_effect *effect) const;
	void add(const tactus_domain *domain, const Part &part);
	void remove(const tactus_effect *effect);
};

/* A fitted parameter; part −1 is the base. */
struct Slot {
	long part;
	size_t index;
	const tactus_parameter *info;
	double scale;
};

/* How a reading's noise is coloured, per output: w_t = (x_t − Σ a_k x_{t−k}) / σ is white with variance 1. */
struct Noise {
	std::vector<double> a[TACTUS_OUTPUTS_MAX];
	double sigma[TACTUS_OUTPUTS_MAX] = {1, 1, 1, 1};  /* of the innovations, scaled units */
	double spread[TACTUS_OUTPUTS_MAX] = {1, 1, 1, 1}; /* of the noise itself, scaled units */
};

/* A hypothesis at its best parameters. Stacks are whitened; rows that do not count are 0 in them. */
struct Fit {
	Hypothesis hypothesis;
	std::vector<Slot> slots;
	VectorXd residual;
	MatrixXd jacobian;                         /* of the prediction, per slot */
	double square = 0;                         /* Σ residual² over the rows that train */
	double square_of[TACTUS_OUTPUTS_MAX] = {}; /* of each output */
	double parameters = 0;                     /* an instant counts as three */
	double cost = 0;                           /* Schwarz's criterion: Σ n log(square / n) + k log n, n per output */
	bool ok = false;
	bool at_bound = false; /* a strength that was fitted ended at a bound */
};

/* True if a parameter is an instant that is sought over the recording. */
bool instant(const tactus_effect *effect, size_t parameter);
bool searched(const tactus_effect *effect, size_t parameter, enum tactus_search_kind kind);

/* Which rows a fit may see. */
enum class Rows { train, all };

/*
 * Samples of a segment that are alike in all that a chain reads but the time: what has no memory need be computed for
 * the first of each kind only. Bench recordings of known loads hold a few hundred kinds.
 */
struct Kinds {
	std::vector<size_t> of; /* of every sample: its kind; empty: too many kinds */
	size_t count = 0;
	std::vector<std::unique_ptr<double[]>> values; /* that the signals of the kinds are in */
	double *signal[TACTUS_SIGNALS_MAX] = {};       /* NULL where the series has none */
};

class Problem
{
  public:
	/* Series of one channel, one per recording; use[segment][output][sample] says which readings count. */
	Problem(std::vector<const tactus_series *> segments, const std::vector<std::vector<std::vector<char>>> &use);

	const tactus_domain *domain;
	std::vector<const tactus_series *> segments;
	std::vector<Run> runs;
	std::vector<size_t> sample; /* of every row */
	std::vector<int> block;     /* of every row: hold-out unit, −1 in a gap between two that are apart */
	int block_count = 0;
	std::vector<char> test; /* per block: no choice sees it */
	std::vector<int> fold;  /* per block that trains */
	bool whole_recordings = false, thinned = false;
	VectorXd measured; /* reading / scale of its output */
	double scale[TACTUS_OUTPUTS_MAX] = {}, range[TACTUS_OUTPUTS_MAX] = {};
	double input_range = 0;
	bool outputs[TACTUS_OUTPUTS_MAX] = {};
	size_t output_count = 0;
	Noise noise;
	/* What the input's own noise does to each output, scaled rms: a reference may be worse than what it calibrates. */
	double blur[TACTUS_OUTPUTS_MAX] = {};
	std::vector<char> excluded;     /* per row: an outlier */
	Index training = 0;             /* rows that train */
	std::vector<Index> training_of; /* of them, those of each output, which follow one another */
	std::vector<char> trained;      /* per row: it trains */

	Index rows() const
	{
		return measured.size();
	}
	size_t input_signal() const;
	/* Why an effect cannot be tested here, or NULL: some recording can, or its covariate differs between them. */
	const char *untestable(const tactus_effect *effect) const;
	/* The signal of the covariate that an effect acts through, -1 if that is none of the domain's. */
	int covariate_of(const tactus_effect *effect) const;
	/* Shares the rows out to blocks; which of them are held out. */
	void make_blocks();
	void count_training();
	bool trains(Index row, Rows which) const;

	/* The outputs of a hypothesis at all rows, scaled. False if one is not finite. */
	bool simulate(const Hypothesis &h, VectorXd &y) const;
	/* Values of a signal (or any per-sample value) at the rows; NaN where it is not recorded. */
	VectorXd at_rows(size_t signal) const;
	/* The noise's filter over every run; of the rows that it has no past for, all but the first become 0. */
	VectorXd whiten(const Eigen::Ref<const VectorXd> &x) const;
	void mask(Eigen::Ref<VectorXd> w, Rows which) const;
	/* The values of the rows that train, close together. */
	VectorXd training_rows(const Eigen::Ref<const VectorXd> &w) const;

	/* `start` or `scale` of a parameter, which are stated for ranges of 1, in these data. */
	double ranged(const tactus_parameter &info, double value) const;
	/* A neutral part with its constants stated for these data; nothing free. */
	Part neutral(const tactus_effect *effect) const;
	std::vector<Slot> slots(const Hypothesis &h) const;
	bool acts(const tactus_parameter &info) const;
	static double &value(Hypothesis &h, const Slot &slot);

	/*
	 * Scatter of the blocks' gradients about 0: what noise that is not quite as modelled (slower, of another size in
	 * each output, a form that does not quite fit) does to the parameters shows in how blocks disagree (Liang & Zeger
	 * 1986). Rows that do not count are 0 in the columns. All 0 where there are too few blocks.
	 */
	MatrixXd scatter(const MatrixXd &columns, const VectorXd &residual) const;

	/* The hypothesis at the least squares of whitened residuals over those rows, from where it stands. */
	Fit fit(const Hypothesis &start, Rows which) const;
	/*
	 * The same with the base parameters that are free at plain least squares, of outputs over their noise: weighted by
	 * slow noise they may leave a level and a slope that nobody would draw. As it is where that changes little.
	 */
	Hypothesis levelled(const Hypothesis &h, Rows which) const;
	/* Estimates blur from the residual at y (scaled): what the input says and the readings do not. */
	void estimate_blur(const VectorXd &y);
	/* What cannot be simulated better: an output's noise, the input's where that is larger with it; scaled rms. */
	double floor(size_t output) const;
	/* What a hypothesis leaves of the rows that train, neither whitened nor weighted; 0 in the others. */
	VectorXd left(const Hypothesis &h) const;
	/* Squares of an output's whitened training rows that are the input's noise and more. */
	double blurred(size_t output) const;
	/* Residual and derivatives where it stands, without moving. */
	Fit evaluate(const Hypothesis &h, Rows which) const;
	/*
	 * Held-out squares per block and output (output by output within a block), training blocks left out in folds (one
	 * Gauss-Newton step each); test ones as is.
	 */
	std::vector<double> held_out(const Fit &fit) const;

  private:
	std::vector<Kinds> kinds; /* per segment */
	bool derivatives(const Hypothesis &h, const VectorXd &y0, const std::vector<Slot> &slots, MatrixXd &d) const;
	void finish(Fit &fit, Rows which) const;
	void refine_instants(Fit &fit, Rows which) const;
};

} // namespace tactus::explain

#endif
