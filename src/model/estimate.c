/* Estimation: readings and a model → force, reading by reading; channels that feel each other are solved jointly. */
#include "model/estimate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"

enum { SWEEPS_MAX = 100 };
static const double converged = 1e-12; /* change of a force between sweeps, of the calibrated range */
static const double same_load = 4; /* dc and ac of a scan that differ by more standard uncertainties are not one load */

/* ---- setting up ---- */

static enum tactus_row_mode mode_of(const char *mode)
{
	if (mode == NULL || *mode == '\0')
		return TACTUS_ROW_ANY;
	return strcmp(mode, "dc") == 0 ? TACTUS_ROW_DC : TACTUS_ROW_AC;
}

static void describe(tactus_estimator *estimator)
{
	const tactus_model *model = estimator->model;
	tactus_columns *columns = &estimator->columns;
	tactus_columns_of_domain(model->domain, columns);
	for (size_t o = 0; o < columns->output_count; o++) {
		columns->name[columns->output_signal[o]] = model->output_name[o];
		estimator->output_mode[o] = mode_of(model->output_mode[o]);
	}
	columns->name[columns->input_signal] = NULL; /* the reference is not looked at */
	estimator->halves = model->output_name[0] != NULL && model->output_name[1] != NULL &&
						estimator->output_mode[0] != estimator->output_mode[1];
}

static int make_channel(tactus_estimator *estimator, size_t c)
{
	const tactus_model *model = estimator->model;
	tactus_estimator_channel *channel = &estimator->channels[c];
	channel->data = &model->channels[c];
	for (size_t k = 0; k < model->effect_count; k++) {
		const tactus_effect *effect = model->effects[k];
		if (tactus_effect_neutral(effect, channel->data->effect[k]))
			continue;
		if ((effect->flags & TACTUS_EFFECT_RESTAMP) != 0) /* its first parameter is the offset */
			channel->offset_s += channel->data->effect[k][0];
		for (size_t s = 0; s < model->domain->signal_count; s++)
			if (strcmp(model->domain->signals[s].name, effect->covariate) == 0)
				estimator->needed[s] = true;
	}
	estimator->moved = estimator->moved || channel->offset_s != 0;
	if (model->form != TACTUS_FORM_FORWARD)
		return TACTUS_OK;
	int status = tactus_inverse_new(model, channel->data, &channel->inverse);
	if (status == TACTUS_OK && tactus_inverse_coupled(channel->inverse))
		estimator->coupled = true;
	return status;
}

int tactus_estimator_new(const tactus_model *model, tactus_estimator **result)
{
	if (model->domain != &tactus_domain_sensor)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED,
						   "a '%s' model turns known loads into readings: force needs a model of domain 'sensor'",
						   model->domain->name);
	if (model->channel_count == 0)
		return tactus_fail(TACTUS_ERR_DATA, "the model has no channel");
	tactus_estimator *estimator = calloc(1, sizeof *estimator);
	if (estimator == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for an estimator");
	estimator->model = tactus_model_copy(model);
	estimator->channels = calloc(model->channel_count + 1, sizeof *estimator->channels);
	int status = TACTUS_OK;
	if (estimator->model == NULL || estimator->channels == NULL) {
		status = tactus_fail(TACTUS_ERR_MEMORY, "no memory for an estimator of %zu channels", model->channel_count);
	} else {
		describe(estimator);
		for (size_t c = 0; status == TACTUS_OK && c < model->channel_count; c++)
			status = make_channel(estimator, c);
	}
	if (status < 0) {
		tactus_estimator_free(estimator);
		return status;
	}
	tactus_estimator_reset(estimator);
	*result = estimator;
	return TACTUS_OK;
}

void tactus_estimator_free(tactus_estimator *estimator)
{
	if (estimator == NULL)
		return;
	for (size_t c = 0; estimator->model != NULL && estimator->channels != NULL && c < estimator->model->channel_count;
		 c++)
		tactus_inverse_free(estimator->channels[c].inverse);
	free(estimator->channels);
	tactus_model_free(estimator->model);
	free(estimator->quality);
	free(estimator->text);
	free(estimator->scan);
	free(estimator->forces);
	free(estimator);
}

static void forget_scan(tactus_estimator_channel *channel)
{
	channel->sequence = NAN;
	channel->half.force = NAN;
	channel->pair_quality = 0;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		channel->pair[o] = NAN;
}

void tactus_estimator_reset(tactus_estimator *estimator)
{
	estimator->end_channel = NAN;
	for (size_t c = 0; c < estimator->model->channel_count; c++) {
		tactus_estimator_channel *channel = &estimator->channels[c];
		if (channel->inverse != NULL)
			tactus_inverse_reset(channel->inverse);
		for (int m = 0; m < TACTUS_ROW_MODES; m++)
			channel->latest[m] = NAN;
		forget_scan(channel);
	}
}

/* ---- one row ---- */

static tactus_estimator_channel *find_channel(tactus_estimator *estimator, int number)
{
	size_t count = estimator->model->channel_count;
	for (size_t k = 0; k < count; k++) { /* channels come in turn: the one before and the next are the likely ones */
		size_t c = (estimator->last + k) % count;
		if (estimator->channels[c].data->channel == number) {
			estimator->last = c;
			return &estimator->channels[c];
		}
	}
	return NULL;
}

/* The load of a neighbour as it was last estimated, from the same kind of reading where there is one; 0 if never. */
static double neighbour_force(const tactus_estimator *estimator, int number, enum tactus_row_mode mode)
{
	for (size_t c = 0; c < estimator->model->channel_count; c++) {
		const double *latest = estimator->channels[c].latest;
		if (estimator->channels[c].data->channel != number)
			continue;
		if (!isnan(latest[mode]))
			return latest[mode];
		for (int m = 0; m < TACTUS_ROW_MODES; m++)
			if (!isnan(latest[m]))
				return latest[m];
	}
	return 0;
}

/* Neighbours' forces, and the fill where a covariate that no effect asks for was not recorded. */
static void complete(const tactus_estimator *estimator, const tactus_estimator_row *row,
					 tactus_inverse_reading *reading)
{
	const tactus_domain *domain = estimator->model->domain;
	int neighbour = row->channel - 1;
	for (size_t s = 0; s < domain->signal_count; s++) {
		if (domain->signals[s].role == TACTUS_ROLE_NEIGHBOUR) {
			reading->signal[s] = estimator->coupled ? neighbour_force(estimator, neighbour, row->mode) : 0;
			neighbour = row->channel + 1;
		} else if (domain->signals[s].role == TACTUS_ROLE_COVARIATE && isnan(reading->signal[s]) &&
				   !estimator->needed[s]) {
			reading->signal[s] = domain->signals[s].fill;
		}
	}
}

/* Leaves the outputs that the model has for such rows. How many there are, and how many of them have a value. */
static void select_outputs(const tactus_estimator *estimator, const tactus_estimator_row *row,
						   tactus_inverse_reading *reading, size_t *wanted, size_t *present)
{
	*wanted = *present = 0;
	for (size_t o = 0; o < estimator->columns.output_count; o++) {
		enum tactus_row_mode mode = estimator->output_mode[o];
		bool applies = estimator->model->output_name[o] != NULL &&
					   (mode == TACTUS_ROW_ANY || row->mode == TACTUS_ROW_ANY || mode == row->mode);
		if (!applies)
			reading->output[o] = NAN;
		*wanted += applies;
		*present += isnan(reading->output[o]) ? 0 : 1;
	}
}

/* A scan's dc and ac readings are of one load unless they contradict each other: then it moved between them. */
static tactus_inverse_result join_halves(tactus_estimator_channel *channel, tactus_inverse_result own)
{
	tactus_inverse_result half = channel->half;
	channel->half = own;
	double both = hypot(half.std, own.std);
	if (isnan(half.force) || isnan(own.force) || !(fabs(half.force - own.force) <= same_load * both))
		return own;
	return tactus_inverse_combine(own, half);
}

static void invert(const tactus_estimator *estimator, tactus_estimator_channel *channel,
				   const tactus_estimator_row *row, const tactus_inverse_reading *reading, tactus_force *force)
{
	tactus_inverse_result result = tactus_inverse_solve(channel->inverse, reading);
	bool clipped = (row->quality & TACTUS_QUALITY_CLIPPED) != 0; /* a bound: it feeds the memory, it is no estimate */
	if (clipped)
		result.force = result.std = NAN;
	if (estimator->halves && !isnan(row->sequence))
		result = join_halves(channel, result);
	tactus_inverse_commit(channel->inverse, reading, result.memory);
	if (!isnan(result.memory))
		channel->latest[row->mode] = result.memory;
	force->quality |= result.quality;
	/* A force belongs to the instant Δ before its reading; the neighbours that press on it now were then otherwise. */
	if (channel->offset_s != 0 && tactus_inverse_coupled(channel->inverse))
		force->quality |= TACTUS_QUALITY_APPROXIMATE;
	force->force_N = result.force;
	force->force_std_N = result.std;
}

static bool beyond(double value, double low, double high)
{
	double tolerance = 0.02 * (high - low);
	return value < low - tolerance || value > high + tolerance;
}

/* An estimator of two readings: the row that completes the pair has the force. */
static void estimate_pair(const tactus_estimator *estimator, tactus_estimator_channel *channel,
						  const tactus_inverse_reading *reading, tactus_force *force)
{
	const tactus_model_channel_data *data = channel->data;
	for (size_t o = 0; o < 2; o++)
		if (!isnan(reading->output[o])) {
			channel->pair[o] = reading->output[o];
			channel->pair_std[o] = reading->output_std[o];
		}
	channel->pair_quality |= force->quality;
	if (isnan(channel->pair[0]) || isnan(channel->pair[1]))
		return;
	force->quality |= channel->pair_quality;
	double std, value = tactus_estimator_evaluate(estimator->model->form, data, channel->pair, channel->pair_std, &std);
	if ((force->quality & TACTUS_QUALITY_CLIPPED) == 0) {
		force->force_N = value;
		force->force_std_N = std;
	}
	if (beyond(value, data->input_min, data->input_max) ||
		beyond(channel->pair[0], data->output_min[0], data->output_max[0]) ||
		beyond(channel->pair[1], data->output_min[1], data->output_max[1]))
		force->quality |= TACTUS_QUALITY_EXTRAPOLATED;
	forget_scan(channel);
}

tactus_force tactus_estimator_row_force(tactus_estimator *estimator, const tactus_estimator_row *row)
{
	tactus_force force = {NAN, NAN, row->reading.signal[estimator->columns.time_signal], row->quality};
	tactus_estimator_channel *channel = find_channel(estimator, row->channel);
	if (channel == NULL) {
		force.quality |= TACTUS_QUALITY_UNCALIBRATED;
		return force;
	}
	force.time_s -= channel->offset_s;
	tactus_inverse_reading reading = row->reading;
	size_t wanted, present;
	select_outputs(estimator, row, &reading, &wanted, &present);
	if (wanted == 0)
		return force;
	if (row->sequence != channel->sequence && !isnan(row->sequence)) {
		forget_scan(channel);
		channel->sequence = row->sequence;
	}
	bool every = channel->inverse == NULL; /* an estimator needs all that the row should have */
	if (present == 0 || (every && present < wanted)) {
		force.quality |= TACTUS_QUALITY_MISSING;
		return force;
	}
	complete(estimator, row, &reading);
	if (channel->inverse != NULL)
		invert(estimator, channel, row, &reading, &force);
	else
		estimate_pair(estimator, channel, &reading, &force);
	return force;
}

/* ---- a scan ---- */

/* One Gauss–Seidel sweep over the rows; returns the largest change, in calibrated ranges. */
static double sweep(tactus_estimator *estimator, const tactus_estimator_row *rows, size_t n, tactus_force *forces)
{
	double largest = 0;
	for (size_t i = 0; i < n; i++) {
		double before = forces[i].force_N;
		forces[i] = tactus_estimator_row_force(estimator, &rows[i]);
		const tactus_estimator_channel *channel = &estimator->channels[estimator->last];
		double range = channel->data->input_max - channel->data->input_min;
		double change = fabs(forces[i].force_N - before) / (range > 0 ? range : fmax(1, fabs(before)));
		if (!isnan(forces[i].force_N))
			largest = isnan(before) ? INFINITY : fmax(largest, change);
	}
	return largest;
}

/* Memory goes back to what it was before the scan; the last forces stay: they are what the next sweep stands on. */
static void rewind_scan(tactus_estimator *estimator, bool save)
{
	for (size_t c = 0; c < estimator->model->channel_count; c++) {
		tactus_estimator_channel *channel = &estimator->channels[c];
		forget_scan(channel);
		if (save)
			tactus_inverse_save(channel->inverse);
		else
			tactus_inverse_restore(channel->inverse);
	}
}

void tactus_estimator_scan(tactus_estimator *estimator, const tactus_estimator_row *rows, size_t n,
						   tactus_force *forces)
{
	double change = INFINITY;
	for (size_t i = 0; i < n; i++)
		forces[i].force_N = NAN;
	for (int k = 0; k < SWEEPS_MAX && change > converged; k++) {
		rewind_scan(estimator, k == 0);
		change = sweep(estimator, rows, n, forces);
	}
	for (size_t i = 0; i < n && change > converged; i++)
		forces[i].quality |= TACTUS_QUALITY_ILL_CONDITIONED;
}

/* ---- one sample ---- */

int tactus_estimator_sample(tactus_estimator *estimator, const tactus_sample *sample, tactus_force *force)
{
	tactus_estimator_row row = {
		.reading = {.output = {sample->conductance_S, sample->capacitance_F},
					.output_std = {sample->conductance_std_S, sample->capacitance_std_F}},
		.sequence = (double)sample->sequence,
		.channel = sample->channel,
		.mode = sample->ac ? TACTUS_ROW_AC : TACTUS_ROW_DC,
	};
	row.reading.signal[SENSOR_TIME] = sample->time_s;
	row.reading.signal[SENSOR_DRIVE] = sample->drive_V;
	row.reading.signal[SENSOR_FREQUENCY] = sample->frequency_Hz;
	row.reading.signal[SENSOR_TEMPERATURE] = sample->temperature_degC;
	*force = tactus_estimator_row_force(estimator, &row);
	return TACTUS_OK;
}
