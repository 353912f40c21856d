/* Numbers and names of a diagnosis as people read them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "diagnose.h"

/* ---- units ---- */

struct unit {
	const char *ascii, *shown;
	int smallest, largest; /* powers of ten of the prefixes that are in use with it */
};

static const struct unit units[] = {
	{"S", "S", -15, 0},    {"F", "F", -15, 0},   {"V", "V", -9, 0},  {"A", "A", -12, 0},   {"ohm", "Ω", -3, 9},
	{"Hz", "Hz", -3, 9},   {"s", "s", -9, 0},    {"N", "N", -3, 3},  {"Nm", "N m", -3, 3}, {"m", "m", -9, 0},
	{"rad", "rad", -6, 0}, {"degC", "°C", 0, 0}, {"pct", "%", 0, 0}, {"1", "", 0, 0},
};

static const struct unit *find_unit(const char *ascii)
{
	for (size_t i = 0; i < sizeof units / sizeof *units; i++)
		if (strcmp(units[i].ascii, ascii) == 0)
			return &units[i];
	return NULL;
}

int cli_si_prefix(double value, const char *unit, char text[32])
{
	static const char *const prefix[] = {"f", "p", "n", "µ", "m", "", "k", "M", "G"};
	const char *name = unit ? unit : "";
	const struct unit *known = find_unit(name);
	double size = fabs(value);
	int power = 0;
	if (known && known->smallest < known->largest && size > 0 && isfinite(size))
		power = 3 * (int)floor(log10(size * (1 + 1e-12)) / 3);
	if (power == -3 && size >= 0.01 && strchr("Nsm", *name)) /* 0.11 N, as people say it */
		power = 0;
	if (known)
		power = power < known->smallest ? known->smallest : power > known->largest ? known->largest : power;
	snprintf(text, 32, "%s%s", prefix[5 + power / 3], known ? known->shown : name);
	return power;
}

/* ---- numbers ---- */

static void put_exponent(char *text, size_t size, const char *mantissa, int exponent)
{
	static const char *const high[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
	char digits[16];
	size_t n = (size_t)snprintf(text, size, "%s×10%s", mantissa, exponent < 0 ? "⁻" : "");
	snprintf(digits, sizeof digits, "%d", exponent < 0 ? -exponent : exponent);
	for (const char *d = digits; *d && n < size; d++)
		n += (size_t)snprintf(text + n, size - n, "%s", high[*d - '0']);
}

/* As many digits as are shown: what is rounded up to a thousand, or from below one to one, counts as that. */
static double rounded(double value, int digits)
{
	char text[48];
	snprintf(text, sizeof text, "%.*e", digits - 1, value);
	return strtod(text, NULL);
}

/* The value with so many places behind the point, a power of ten apart where it is far from one. */
static void put_number(char *text, size_t size, double value, int digits)
{
	double shown = rounded(value, digits);
	int power = shown != 0 ? (int)floor(log10(fabs(shown)) + 1e-12) : 0, places = digits - 1 - power;
	char mantissa[32];
	if (power >= -3 && power < 6) {
		snprintf(text, size, "%s%.*f", value < 0 ? "−" : "", places > 0 ? places : 0, fabs(value));
		return;
	}
	snprintf(mantissa, sizeof mantissa, "%s%.*f", value < 0 ? "−" : "", digits - 1, fabs(value) / pow(10, power));
	put_exponent(text, size, mantissa, power);
}

static const char *join_unit(char *text, size_t size, const char *number, const char *unit)
{
	snprintf(text, size, "%.60s%s%.20s", number, *unit ? " " : "", unit);
	return text;
}

/* What stands where there is no number. */
static const char *none(char *text)
{
	memcpy(text, "–", sizeof "–");
	return text;
}

const char *cli_si_like(double value, double like, const char *unit, int digits, char text[64])
{
	char shown[32], number[40];
	if (!isfinite(value))
		return none(text);
	int power = cli_si_prefix(like, unit, shown);
	put_number(number, sizeof number, value / pow(10, power), digits);
	return join_unit(text, 64, number, shown);
}

const char *cli_si(double value, const char *unit, int digits, char text[64])
{
	return cli_si_like(value, rounded(value, digits), unit, digits, text);
}

const char *cli_si_error(double value, double standard_error, const char *unit, char text[96])
{
	char shown[32], number[32], error[24], both[60];
	if (!isfinite(value))
		return none(text);
	if (!(standard_error > 0) || !isfinite(standard_error))
		return cli_si(value, unit, 4, text);
	double size = fabs(value) > standard_error ? fabs(value) : standard_error;
	int power = cli_si_prefix(size, unit, shown);
	int digits = 2 + (int)(floor(log10(size)) - floor(log10(standard_error)));
	digits = digits > 12 ? 12 : digits;
	int far = (int)floor(log10(size)) - power;
	if (far < -3 || far >= 6) { /* both over the same power of ten */
		snprintf(number, sizeof number, "(%.*f ± %.*f)", digits - 1, value / pow(10, far + power), digits - 1,
				 standard_error / pow(10, far + power));
		put_exponent(both, sizeof both, number, far);
		return join_unit(text, 96, both, shown);
	}
	int places = digits - 1 - far;
	places = places < 0 ? 0 : places;
	snprintf(number, sizeof number, "%s%.*f", value < 0 ? "−" : "", places, fabs(value) / pow(10, power));
	snprintf(error, sizeof error, "%.*f", places, standard_error / pow(10, power));
	snprintf(both, sizeof both, "%s ± %s", number, error);
	return join_unit(text, 96, both, shown);
}

const char *cli_percent(double share, char text[32])
{
	double percent = 100 * share, size = fabs(percent);
	if (!isfinite(percent))
		return none(text);
	int places = size < 0.95 || (size > 99 && size < 100) ? 1 : 0;
	if (size > 99.9 && size < 100)
		size = 99.9;
	snprintf(text, 32, "%s%.*f %%", percent < 0 && size >= 0.05 ? "−" : "", places, size);
	return text;
}

const char *cli_of_noise(const tactus_base_error *base, char text[32])
{
	double share = base->rmse / base->noise_floor;
	if (!(base->noise_floor > 0) || !isfinite(share))
		return none(text);
	snprintf(text, 32, share < 9.95 ? "%.1f ×" : share < 1e6 ? "%.0f ×" : "%.1e ×", share);
	return text;
}

const char *cli_of_explainable(double share, char text[32])
{
	char percent[32];
	if (!isfinite(share))
		return none(text);
	snprintf(text, 32, "%s", share < 0.995 ? cli_percent(share, percent) : "all");
	return text;
}

const char *cli_force_after(const tactus_diagnosed *series, int digits, char text[96])
{
	const tactus_gain *gain = series->gain;
	bool coupled = false;
	for (size_t i = 0; i < series->cause_count; i++)
		coupled = coupled || strstr(series->causes[i].covariate, "of the neighbours");
	if (isfinite(gain->force_rmse_after_N))
		return cli_si_like(gain->force_rmse_after_N, gain->force_rmse_before_N, "N", digits, text);
	snprintf(text, 96, "not known in newtons%s", coupled ? ", the channels being coupled and judged one by one" : "");
	return text;
}

const char *cli_bic(double delta_bic, char text[32])
{
	if (!isfinite(delta_bic))
		return none(text);
	snprintf(text, 32, "%s%.*f", delta_bic < 0 ? "−" : "+", fabs(delta_bic) < 10 ? 1 : 0, fabs(delta_bic));
	return text;
}

const char *cli_bic_word(double delta_bic)
{
	if (delta_bic > -2)
		return "no";
	return delta_bic > -6 ? "weak" : delta_bic > -10 ? "strong" : delta_bic > -100 ? "very strong" : "overwhelming";
}

/* ---- names ---- */

const char *cli_quantity_name(const char *column, char text[64])
{
	const char *suffix = strrchr(column, '_');
	size_t length = suffix && find_unit(suffix + 1) ? (size_t)(suffix - column) : strlen(column);
	snprintf(text, 64, "%.*s", (int)(length < 60 ? length : 60), column);
	for (char *c = text; *c; c++)
		if (*c == '_')
			*c = ' ';
	return text;
}

const char *cli_column_unit(const char *column)
{
	const char *suffix = strrchr(column, '_');
	return suffix && find_unit(suffix + 1) ? suffix + 1 : "";
}

const char *cli_verdict_words(enum tactus_verdict verdict)
{
	switch (verdict) {
	case TACTUS_VERDICT_CAUSE_FOUND:
		return "cause found";
	case TACTUS_VERDICT_NOTHING_WRONG:
		return "nothing wrong";
	case TACTUS_VERDICT_UNEXPLAINED:
		return "unexplained";
	case TACTUS_VERDICT_AMBIGUOUS:
		return "ambiguous";
	case TACTUS_VERDICT_STALE_CALIBRATION:
		return "stale calibration";
	case TACTUS_VERDICT_BAD_RECORDING:
		return "bad recording";
	}
	return "";
}

const tactus_base_error *cli_worst_base(const tactus_diagnosed *series)
{
	const tactus_base_error *worst = NULL;
	double most = -1;
	for (size_t i = 0; i < series->base_count; i++) {
		double share = series->base[i].rmse / series->base[i].noise_floor;
		if (!worst || share > most) {
			worst = &series->base[i];
			most = share;
		}
	}
	return worst;
}

const char *cli_no_force_gain(const tactus_diagnosed *series)
{
	return series->gain ? series->gain->no_force_gain : NULL;
}
