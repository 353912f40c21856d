/* tactus diagnose --json: the contract's keys, in its order. */
#include <math.h>

#include "diagnose.h"

static void json_problems(struct cli_json *json, const tactus_diagnosis *diagnosis)
{
	cli_json_array(json, "problems");
	for (size_t i = 0; i < diagnosis->problem_count; i++) {
		const tactus_problem *problem = &diagnosis->problems[i];
		cli_json_object(json, NULL);
		cli_json_string(json, "kind", problem->kind);
		cli_json_string(json, "text", problem->text);
		cli_json_array(json, "rows");
		for (size_t r = 0; r < problem->row_count; r++)
			cli_json_number(json, NULL, (double)problem->rows[r]);
		cli_json_close(json);
		cli_json_close(json);
	}
	cli_json_close(json);
}

static void json_base(struct cli_json *json, const tactus_diagnosed *series)
{
	cli_json_array(json, "base");
	for (size_t i = 0; i < series->base_count; i++) {
		const tactus_base_error *base = &series->base[i];
		cli_json_object(json, NULL);
		cli_json_string(json, "output", base->output);
		cli_json_string(json, "unit", base->unit);
		cli_json_number(json, "rmse", base->rmse);
		cli_json_number(json, "refit_rmse", base->refit_rmse);
		cli_json_number(json, "noise_floor", base->noise_floor);
		cli_json_close(json);
	}
	cli_json_close(json);
}

/* Of what is unexplained the contract has no significance: it stands because it is large. */
static void json_dependences(struct cli_json *json, const char *key, const tactus_dependence *list, size_t n,
							 bool significance)
{
	cli_json_array(json, key);
	for (size_t i = 0; i < n; i++) {
		cli_json_object(json, NULL);
		cli_json_string(json, "covariate", list[i].covariate);
		cli_json_number(json, "explained", list[i].explained);
		if (significance)
			cli_json_number(json, "p_value", list[i].p_value);
		cli_json_string(json, "text", list[i].text);
		cli_json_close(json);
	}
	cli_json_close(json);
}

static void json_interval(struct cli_json *json, const char *key, const double interval[2])
{
	cli_json_array(json, key);
	cli_json_number(json, NULL, interval[0]);
	cli_json_number(json, NULL, interval[1]);
	cli_json_close(json);
}

static void json_parameters(struct cli_json *json, const tactus_cause *cause)
{
	cli_json_array(json, "parameters");
	for (size_t i = 0; i < cause->parameter_count; i++) {
		const tactus_found_parameter *parameter = &cause->parameters[i];
		cli_json_object(json, NULL);
		cli_json_string(json, "name", parameter->name);
		cli_json_number(json, "value", parameter->value);
		cli_json_string(json, "unit", parameter->unit);
		cli_json_number(json, "standard_error", parameter->standard_error);
		cli_json_close(json);
	}
	cli_json_close(json);
}

static void json_cause(struct cli_json *json, const tactus_cause *cause)
{
	cli_json_object(json, NULL);
	cli_json_string(json, "effect", cause->effect);
	cli_json_string(json, "summary", cause->summary);
	cli_json_string(json, "source", cause->source);
	json_parameters(json, cause);
	cli_json_object(json, "evidence");
	cli_json_number(json, "delta_bic", cause->delta_bic);
	cli_json_number(json, "held_out_gain", cause->held_out_gain);
	json_interval(json, "held_out_gain_ci95", cause->held_out_gain_ci95);
	cli_json_number(json, "p_value", cause->p_value);
	cli_json_close(json);
	/* What the data cannot tell from the cause; where nothing is, what else was considered. */
	size_t rivals = cause->inseparable > 0 ? cause->inseparable : cause->rival_count;
	cli_json_array(json, "rivals");
	for (size_t i = 0; i < rivals; i++) {
		cli_json_object(json, NULL);
		cli_json_string(json, "effect", cause->rivals[i].effect);
		cli_json_number(json, "delta_bic", cause->rivals[i].delta_bic);
		cli_json_bool(json, "testable", cause->rivals[i].testable);
		cli_json_close(json);
	}
	cli_json_close(json);
	cli_json_close(json);
}

static void json_not_testable(struct cli_json *json, const tactus_diagnosed *series)
{
	cli_json_array(json, "not_testable");
	for (size_t i = 0; i < series->candidate_count; i++) {
		if (!series->candidates[i].why)
			continue;
		cli_json_object(json, NULL);
		cli_json_string(json, "effect", series->candidates[i].effect);
		cli_json_string(json, "why", series->candidates[i].why);
		cli_json_close(json);
	}
	cli_json_close(json);
}

static void json_gain(struct cli_json *json, const tactus_gain *gain)
{
	if (!gain) {
		cli_json_string(json, "gain", NULL);
		return;
	}
	cli_json_object(json, "gain");
	cli_json_number(json, "rmse_before", gain->rmse_before);
	cli_json_number(json, "rmse_after", gain->rmse_after);
	cli_json_string(json, "unit", gain->unit);
	cli_json_number(json, "reduction", gain->reduction);
	json_interval(json, "ci95", gain->ci95);
	cli_json_number(json, "of_explainable", gain->of_explainable);
	cli_json_number(json, "force_rmse_before_N", gain->force_rmse_before_N);
	cli_json_number(json, "force_rmse_after_N", gain->force_rmse_after_N);
	cli_json_close(json);
}

static void json_experiment(struct cli_json *json, const tactus_experiment *experiment)
{
	if (!experiment) {
		cli_json_string(json, "next_experiment", NULL);
		return;
	}
	cli_json_object(json, "next_experiment");
	cli_json_array(json, "separates");
	for (size_t i = 0; i < experiment->separates_count; i++)
		cli_json_string(json, NULL, experiment->separates[i]);
	cli_json_close(json);
	cli_json_string(json, "command", experiment->command);
	cli_json_string(json, "text", experiment->text);
	cli_json_close(json);
}

static void json_candidates(struct cli_json *json, const tactus_diagnosed *series)
{
	cli_json_array(json, "candidates");
	for (size_t i = 0; i < series->candidate_count; i++) {
		cli_json_object(json, NULL);
		cli_json_string(json, "effect", series->candidates[i].effect);
		cli_json_number(json, "delta_bic", series->candidates[i].delta_bic);
		cli_json_string(json, "why", series->candidates[i].why);
		cli_json_close(json);
	}
	cli_json_close(json);
}

static void json_series(struct cli_json *json, const tactus_diagnosed *series)
{
	cli_json_object(json, NULL);
	cli_json_number(json, "channel", series->channel ? (double)series->channel : (double)NAN);
	cli_json_number(json, "samples", (double)series->samples);
	cli_json_string(json, "verdict", tactus_verdict_name(series->verdict));
	json_base(json, series);
	json_dependences(json, "wrong", series->wrong, series->wrong_count, true);
	cli_json_array(json, "causes");
	for (size_t i = 0; i < series->cause_count; i++)
		json_cause(json, &series->causes[i]);
	cli_json_close(json);
	cli_json_bool(json, "structure_remains", series->structure_remains);
	json_dependences(json, "unexplained", series->unexplained, series->unexplained_count, false);
	json_not_testable(json, series);
	json_gain(json, series->gain);
	json_experiment(json, series->experiment);
	json_candidates(json, series);
	cli_json_number(json, "every", (double)series->every);
	cli_json_number(json, "force_rmse_N", series->force_rmse_N);
	cli_json_string(json, "moved", series->moved);
	cli_json_close(json);
}

void cli_diagnose_json(FILE *out, const tactus_diagnosis *diagnosis, const char *extended)
{
	struct cli_json *json = cli_json_open(out);
	cli_json_array(json, "recordings");
	for (size_t i = 0; i < diagnosis->recording_count; i++)
		cli_json_string(json, NULL, diagnosis->recordings[i]);
	cli_json_close(json);
	cli_json_string(json, "domain", diagnosis->domain);
	cli_json_string(json, "verdict", tactus_verdict_name(diagnosis->verdict));
	cli_json_string(json, "summary", diagnosis->summary);
	json_problems(json, diagnosis);
	cli_json_array(json, "series");
	for (size_t i = 0; i < diagnosis->series_count; i++)
		json_series(json, &diagnosis->series[i]);
	cli_json_close(json);
	cli_json_string(json, "extended_model", extended);
	cli_json_end(json);
}
