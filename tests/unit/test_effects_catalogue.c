/* Every effect of the catalogue: its table is consistent, neutral is nothing, blocks and gaps change no bit. */
#include "effects_rig.h"

enum { ROWS = 2100 };

typedef void (*check)(const tactus_domain *domain, const tactus_effect *effect);

static void for_every_effect(check run)
{
	for (size_t d = 0; tactus_domain_at(d); d++)
		for (size_t k = 0; k < tactus_domain_effects(tactus_domain_at(d)); k++) {
			const tactus_effect *effect = tactus_domain_effect(tactus_domain_at(d), k);
			print_message("  %s\n", effect->name);
			run(tactus_domain_at(d), effect);
		}
}

/* Strengths where a fit starts, everything else at its start too, but constants where they are by default. */
static void start(const tactus_effect *effect, double *p)
{
	for (size_t i = 0; i < effect->parameter_count; i++) {
		const tactus_parameter *q = &effect->parameters[i];
		p[i] = q->kind == TACTUS_CONSTANT ? q->neutral : q->start;
	}
}

static void check_table(const tactus_domain *domain, const tactus_effect *effect)
{
	size_t strengths = 0;
	assert_true(effect->stage >= 0 && (size_t)effect->stage < domain->stage_count);
	assert_true(effect->parameter_count > 0 && effect->parameter_count <= TACTUS_PARAMETERS_MAX);
	assert_true(strlen(effect->summary) > 0 && strlen(effect->source) > 0);
	assert_true(strlen(effect->covariate) > 0 && strlen(effect->needs) > 0);
	assert_non_null(effect->confused_with);
	assert_non_null(effect->testable);
	assert_true((effect->state_size > 0) == (effect->reset != NULL));
	assert_true((effect->state_size > 0) == ((effect->flags & TACTUS_EFFECT_ORDER) != 0));
	for (size_t i = 0; i < effect->parameter_count; i++) {
		const tactus_parameter *q = &effect->parameters[i];
		strengths += q->kind == TACTUS_STRENGTH;
		assert_true(q->lower < q->upper);
		assert_true(q->neutral >= q->lower && q->neutral <= q->upper);
		assert_true(q->start >= q->lower && q->start <= q->upper);
		assert_true(q->kind != TACTUS_STRENGTH || q->start != q->neutral);
		assert_true(q->scale > 0);
		assert_true(q->output >= -1 && q->output <= 1);
		assert_true(strlen(q->unit) > 0 && strlen(q->summary) > 0);
		for (size_t j = 0; j < i; j++)
			assert_string_not_equal(q->name, effect->parameters[j].name);
	}
	assert_true(strengths > 0);
}

static void tables_are_consistent(void **unused)
{
	(void)unused;
	for_every_effect(check_table);
}

static void expect_effect(const tactus_domain *domain, const char *name)
{
	for (size_t e = 0; domain->effects[e]; e++)
		if (strcmp(domain->effects[e]->name, name) == 0)
			return;
	fail_msg("domain %s has no effect %s", domain->name, name);
}

/* Scripts match on these names: none goes away. Others may come. */
static void the_published_names_stay(void **unused)
{
	(void)unused;
	static const char *const sensor[] = {
		"nonlinearity", "saturation",         "dead-zone",      "hysteresis",  "creep",
		"lag",          "cyclic-decline",     "linear-decline", "drift",       "step-change",
		"temperature",  "voltage-dependence", "self-heating",   "time-offset", "mechanical-crosstalk",
		"mains-hum",
	};
	static const char *const readout[] = {
		"switch-resistance",    "stray-capacitance", "constant-phase-element", "amplifier-bandwidth",
		"feedback-capacitance", "phase-offset",      "comparator-delay",       "comparator-hysteresis",
		"rectifier-offset",     "gain-error",        "settling-crosstalk",     "output-clipping",
		"adc-quantisation",
	};
	for (size_t i = 0; i < sizeof sensor / sizeof *sensor; i++)
		expect_effect(&tactus_domain_sensor, sensor[i]);
	for (size_t i = 0; i < sizeof readout / sizeof *readout; i++)
		expect_effect(&tactus_domain_readout, readout[i]);
}

/* The covariate is a column of the domain, or says of what it is one. */
static void check_covariate(const tactus_domain *domain, const tactus_effect *effect)
{
	bool known = strcmp(effect->covariate, "row order") == 0;
	for (size_t s = 0; s < domain->signal_count; s++)
		known |= strncmp(effect->covariate, domain->signals[s].name, strlen(domain->signals[s].name)) == 0;
	assert_true(known);
}

static void covariates_are_columns(void **unused)
{
	(void)unused;
	for_every_effect(check_covariate);
}

static void compare_bits(const rig_recording *a, const rig_recording *b)
{
	for (size_t s = 0; s < a->domain->signal_count; s++)
		if (rig_is_output(a, s))
			assert_memory_equal(a->signal[s], b->signal[s], a->n * sizeof(double));
}

/* Strengths at neutral and everything else far from it: not a bit changes. */
static void check_neutral(const tactus_domain *domain, const tactus_effect *effect)
{
	double p[TACTUS_PARAMETERS_MAX];
	rig_recording bare = rig_record(domain, ROWS), neutral = rig_record(domain, ROWS);
	start(effect, p);
	for (size_t i = 0; i < effect->parameter_count; i++)
		if (effect->parameters[i].kind == TACTUS_STRENGTH)
			p[i] = effect->parameters[i].neutral;
	rig_run(&bare, NULL, NULL, ROWS);
	rig_run(&neutral, effect, p, ROWS);
	compare_bits(&bare, &neutral);
	rig_free(&bare);
	rig_free(&neutral);
}

static void neutral_changes_nothing_to_the_last_bit(void **unused)
{
	(void)unused;
	for_every_effect(check_neutral);
}

/*
 * What has no memory and reads no clock may be computed in any order: an effect that says so by its flags gives a
 * sample the same bits wherever it stands.
 */
static void check_order(const tactus_domain *domain, const tactus_effect *effect)
{
	const unsigned ordered =
		TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER | TACTUS_EFFECT_RESTAMP | TACTUS_EFFECT_LOOKAHEAD;
	double p[TACTUS_PARAMETERS_MAX];
	if ((effect->flags & ordered) != 0)
		return;
	rig_recording there = rig_record(domain, ROWS), back = rig_record(domain, ROWS);
	for (size_t s = 0; s < domain->signal_count; s++)
		for (size_t i = 0; domain->signals[s].role != TACTUS_ROLE_TIME && i < ROWS; i++)
			rig_column(&back, s)[i] = rig_column(&there, s)[ROWS - 1 - i];
	start(effect, p);
	rig_run(&there, effect, p, ROWS);
	rig_run(&back, effect, p, ROWS);
	for (size_t s = 0; s < domain->signal_count; s++)
		for (size_t i = 0; rig_is_output(&there, s) && i < ROWS; i++)
			assert_memory_equal(&there.signal[s][i], &back.signal[s][ROWS - 1 - i], sizeof(double));
	rig_free(&there);
	rig_free(&back);
}

static void what_has_no_memory_knows_no_order(void **unused)
{
	(void)unused;
	for_every_effect(check_order);
}

/* The largest difference of an output between two recordings, relative to the output's size. */
static double difference(const rig_recording *a, const rig_recording *b)
{
	double largest = 0;
	for (size_t s = 0; s < a->domain->signal_count; s++) {
		double size = 0, apart = 0;
		for (size_t i = 0; rig_is_output(a, s) && i < a->n; i++) {
			size = fmax(size, fabs(a->signal[s][i]));
			apart = fmax(apart, fabs(a->signal[s][i] - b->signal[s][i]));
		}
		largest = fmax(largest, size > 0 ? apart / size : 0);
	}
	return largest;
}

/* Each strength alone: where a fit starts it shows, and towards neutral it fades without a jump. */
static void check_strengths(const tactus_domain *domain, const tactus_effect *effect)
{
	double p[TACTUS_PARAMETERS_MAX];
	rig_recording bare = rig_record(domain, ROWS), changed = rig_record(domain, ROWS);
	rig_run(&bare, NULL, NULL, ROWS);
	for (size_t i = 0; i < effect->parameter_count; i++) {
		const tactus_parameter *q = &effect->parameters[i];
		double unit = strncmp(q->unit, "output0", 7) == 0 ? 1e-5 : strncmp(q->unit, "output1", 7) == 0 ? 1e-10 : 1;
		if (q->kind != TACTUS_STRENGTH)
			continue;
		rig_neutral(effect, p);
		p[i] = q->neutral + unit * (q->start - q->neutral);
		rig_run(&changed, effect, p, ROWS);
		assert_true(difference(&bare, &changed) > 1e-9);
		p[i] = q->neutral + 1e-9 * unit * (q->start - q->neutral);
		rig_run(&changed, effect, p, ROWS);
		assert_true(difference(&bare, &changed) < 1e-6);
	}
	rig_free(&bare);
	rig_free(&changed);
}

static void every_strength_shows_and_fades_towards_neutral(void **unused)
{
	(void)unused;
	for_every_effect(check_strengths);
}

static void check_blocks(const tactus_domain *domain, const tactus_effect *effect)
{
	static const size_t blocks[] = {1, 7, 511, 513};
	double p[TACTUS_PARAMETERS_MAX];
	rig_recording whole = rig_record(domain, ROWS), parts = rig_record(domain, ROWS);
	start(effect, p);
	rig_run(&whole, effect, p, ROWS);
	for (size_t b = 0; b < sizeof blocks / sizeof blocks[0]; b++) {
		rig_run(&parts, effect, p, blocks[b]);
		compare_bits(&whole, &parts);
	}
	rig_free(&whole);
	rig_free(&parts);
}

static void blocks_of_any_size_give_the_same_bits(void **unused)
{
	(void)unused;
	for_every_effect(check_blocks);
}

static void remove_row(rig_recording *rig, size_t row)
{
	for (size_t s = 0; s < rig->domain->signal_count; s++)
		memmove(rig->signal[s] + row, rig->signal[s] + row + 1, (rig->n - row - 1) * sizeof(double));
	rig->n--;
}

/* A row without its input gives no output, and the rows after it are as if it had not been there. */
static void check_gap(const tactus_domain *domain, const tactus_effect *effect)
{
	static const size_t gaps[] = {0, 1, 700};
	size_t input = domain == &tactus_domain_sensor ? (size_t)SENSOR_FORCE : (size_t)READOUT_DRIVE;
	double p[TACTUS_PARAMETERS_MAX];
	start(effect, p);
	for (size_t g = 0; g < sizeof gaps / sizeof gaps[0]; g++) {
		rig_recording gap = rig_record(domain, ROWS), without = rig_record(domain, ROWS);
		gap.signal[input][gaps[g]] = NAN;
		rig_run(&gap, effect, p, ROWS);
		for (size_t s = 0; s < domain->signal_count; s++)
			if (rig_is_output(&gap, s) && s != READOUT_PHASE) /* the drive does not enter the phase */
				assert_true(isnan(gap.signal[s][gaps[g]]));
		remove_row(&gap, gaps[g]);
		remove_row(&without, gaps[g]);
		rig_run(&without, effect, p, ROWS);
		for (size_t s = 0; s < domain->signal_count; s++)
			if (rig_is_output(&gap, s) && s != READOUT_PHASE)
				assert_memory_equal(gap.signal[s], without.signal[s], gap.n * sizeof(double));
		rig_free(&gap);
		rig_free(&without);
	}
}

static void a_missing_input_gives_no_output_and_leaves_the_state(void **unused)
{
	(void)unused;
	for_every_effect(check_gap);
}

/*
 * The mark is on the stated covariate: with that column frozen, a refit of the base (a line in the load, per output)
 * leaves nothing of the effect; with the column varying it leaves something.
 */
static double left_by_a_line(const double *x, const double *y, size_t n)
{
	double mx = 0, my = 0, xx = 0, xy = 0, left = 0, size = 0;
	for (size_t i = 0; i < n; i++) {
		mx += x[i] / (double)n;
		my += y[i] / (double)n;
	}
	for (size_t i = 0; i < n; i++) {
		xx += (x[i] - mx) * (x[i] - mx);
		xy += (x[i] - mx) * (y[i] - my);
	}
	double slope = xx > 0 ? xy / xx : 0;
	for (size_t i = 0; i < n; i++) {
		left = fmax(left, fabs(y[i] - my - slope * (x[i] - mx)));
		size = fmax(size, fabs(y[i]));
	}
	return left / size;
}

static bool marked_by(const tactus_effect *effect, size_t s)
{
	const char *name = tactus_domain_sensor.signals[s].name;
	if (strcmp(effect->covariate, "force_N of the neighbours") == 0)
		return s == SENSOR_FORCE_BELOW || s == SENSOR_FORCE_ABOVE;
	return strcmp(effect->covariate, name) == 0;
}

static double mark(const tactus_effect *effect, bool frozen)
{
	double p[TACTUS_PARAMETERS_MAX];
	rig_recording rig = rig_record(&tactus_domain_sensor, 500);
	start(effect, p);
	for (size_t i = 0; i < effect->parameter_count; i++) {
		if (effect->parameters[i].kind == TACTUS_INITIAL)
			p[i] = effect->parameters[i].neutral;
		if (strcmp(effect->parameters[i].name, "rate_per_s") == 0)
			p[i] = 0.05;
		if (strcmp(effect->parameters[i].unit, "output0") == 0)
			p[i] *= 5e-5;
		if (strcmp(effect->parameters[i].unit, "output1") == 0)
			p[i] *= 1e-11;
	}
	for (size_t s = 0; s < SENSOR_SIGNALS; s++)
		for (size_t i = 0; frozen && marked_by(effect, s) && i < rig.n; i++)
			rig_column(&rig, s)[i] = s == SENSOR_DRIVE ? 0 : 2.5;
	rig_run(&rig, effect, p, rig.n);
	double left = left_by_a_line(rig.signal[SENSOR_FORCE], rig.signal[SENSOR_G], rig.n);
	rig_free(&rig);
	return left;
}

static void the_mark_is_on_the_stated_covariate(void **unused)
{
	(void)unused;
	for (size_t k = 0; k < tactus_domain_effects(&tactus_domain_sensor); k++) {
		const tactus_effect *effect = tactus_domain_effect(&tactus_domain_sensor, k);
		print_message("  %s\n", effect->name);
		assert_true(mark(effect, true) < 1e-12);
		assert_true(mark(effect, false) > 1e-4);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(tables_are_consistent),
		cmocka_unit_test(the_published_names_stay),
		cmocka_unit_test(covariates_are_columns),
		cmocka_unit_test(neutral_changes_nothing_to_the_last_bit),
		cmocka_unit_test(what_has_no_memory_knows_no_order),
		cmocka_unit_test(every_strength_shows_and_fades_towards_neutral),
		cmocka_unit_test(blocks_of_any_size_give_the_same_bits),
		cmocka_unit_test(a_missing_input_gives_no_output_and_leaves_the_state),
		cmocka_unit_test(the_mark_is_on_the_stated_covariate),
	};
	return cmocka_run_group_tests_name("effects: the catalogue", tests, NULL, NULL);
}
