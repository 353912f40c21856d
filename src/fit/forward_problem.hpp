/* The chain of one channel as a function of its fitted parameters, at the readings that train. */
#ifndef TACTUS_FORWARD_PROBLEM_HPP
#define TACTUS_FORWARD_PROBLEM_HPP

#include <Eigen/Dense>
#include <memory>
#include <string>
#include <vector>

#include "fit/fit_internal.h"

namespace tactus
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

/* A parameter that is fitted, and where it lives: effect −1 is the base. */
struct Slot {
	long effect;
	size_t index;
	const tactus_parameter *info;
	double start, scale, lower, upper;
};

/* A reading that trains. */
struct Row {
	size_t sample;
	double root_weight;
};

struct ChainFree {
	void operator()(tactus_chain *chain) const
	{
		tactus_chain_free(chain);
	}
};

bool fitted(const tactus_parameter &parameter, const bool *outputs);

class ForwardProblem
{
  public:
	/* Every stride-th sample of the series. Throws std::bad_alloc only. */
	ForwardProblem(const tactus_series *series, const tactus_effect *const *effects, size_t effect_count,
				   const double *const *weight, tactus_model_channel_data *data, size_t stride);
	/* TACTUS_ERR_DATA if a reading never changes; sets constants of the model's form in the channel's data. */
	int prepare(bool refit);
	/* Each output counts by its standard deviation here from now on. */
	void set_scales(const double *scales);
	/* The chain with these values, at the rows, weighted. False if anything there is not finite. */
	bool simulate(const VectorXd &values, VectorXd &y);
	bool memoryless() const;
	/* Takes a parameter out of what is fitted (its slot, if it was there) and sets it to its neutral value. */
	std::vector<Slot> take(long effect, size_t index);
	/* Sets a parameter of an effect that is not fitted. */
	void put(long effect, size_t index, double value);
	/* The clock of the series as it is simulated: seconds, one per sample. */
	const double *clock() const;
	size_t clock_size() const;
	/* Values and standard errors into the channel's data. */
	void store(const VectorXd &values, const VectorXd &errors);

	size_t output_count = 0;
	bool outputs[TACTUS_OUTPUTS_MAX] = {};
	double output_scale[TACTUS_OUTPUTS_MAX] = {};
	std::vector<Row> rows[TACTUS_OUTPUTS_MAX]; /* of each output; stacked in this order everywhere */
	VectorXd measured;                         /* reading × √weight / scale of its output */
	std::vector<Slot> slots;
	std::vector<const tactus_effect *> effects;

  private:
	void add_slot(long effect, size_t index, const tactus_parameter &info, double &value, bool refit);
	void thin(size_t stride);

	const tactus_series *series;
	tactus_model_channel_data *data;
	const double *weight[TACTUS_OUTPUTS_MAX] = {};
	size_t samples, step;
	size_t output_signal[TACTUS_OUTPUTS_MAX] = {};
	double output_range[TACTUS_OUTPUTS_MAX] = {}, input_range = 0;
	double *signal[TACTUS_SIGNALS_MAX] = {};
	std::vector<std::vector<double>> owned, predicted;
	std::unique_ptr<tactus_chain, ChainFree> chain;
};

} // namespace tactus

#endif
