/* The scripts of the pictures: data in line, ranges of our own, labels with units. */
#include <math.h>
#include <string.h>

#include "picture.h"

/* ---- axes ---- */

struct axis {
	double scale;       /* what a value is divided by */
	double least, most; /* over all that is drawn, scaled */
	bool logarithmic;
	char label[128];
};

static void widen(struct axis *axis, double value)
{
	if (!isfinite(value))
		return;
	axis->least = fmin(axis->least, value);
	axis->most = fmax(axis->most, value);
}

/* A scale with an SI prefix that suits the values; the label says quantity and unit. */
static struct axis new_axis(const char *quantity, const char *unit, double size)
{
	struct axis axis = {.least = INFINITY, .most = -INFINITY};
	char shown[32], name[64];
	int length = (int)strlen(quantity), most = 36; /* a longer label would leave the picture */
	if (length > most)
		for (length = most - 1; length > 0 && ((unsigned char)quantity[length] & 0xC0) == 0x80;)
			length--;
	snprintf(name, sizeof name, "%.*s%s", length, quantity, quantity[length] ? "…" : "");
	axis.scale = pow(10, cli_si_prefix(size, unit, shown));
	snprintf(axis.label, sizeof axis.label, *shown ? "%s (%s)" : "%s", name, shown);
	return axis;
}

static double largest(const double *values, size_t n)
{
	double most = 0;
	for (size_t i = 0; values && i < n; i++)
		if (isfinite(values[i]))
			most = fmax(most, fabs(values[i]));
	return most;
}

static struct axis column_axis(const char *column, const char *unit, const double *values, size_t n)
{
	char name[64];
	return new_axis(cli_quantity_name(column, name), unit ? unit : cli_column_unit(column), largest(values, n));
}

static struct axis time_axis(const struct pictures *pictures, const double *time_s, size_t n)
{
	struct axis axis = new_axis(pictures->clock ? "time" : "sample", pictures->clock ? "s" : "", 1);
	if (pictures->clock && largest(time_s, n) > 3 * 3600) {
		axis.scale = 3600;
		strcpy(axis.label, "time (h)");
	}
	return axis;
}

/* Decades on a logarithmic axis; call before widening. */
static void perhaps_logarithmic(struct axis *axis, const double *values, size_t n, double ratio)
{
	double least = INFINITY, most = 0;
	for (size_t i = 0; i < n; i++) {
		if (!isfinite(values[i]))
			continue;
		if (values[i] <= 0)
			return;
		least = fmin(least, values[i]);
		most = fmax(most, values[i]);
	}
	axis->logarithmic = most > ratio * least;
}

void picture_text(FILE *script, const char *text)
{
	fputc('\'', script);
	for (; *text; text++)
		if (*text == '\'')
			fputs("''", script);
		else
			fputc((unsigned char)*text < ' ' || *text == '`' ? ' ' : *text, script);
	fputc('\'', script);
}

static void put_axis(FILE *script, const char *which, const struct axis *axis)
{
	double least = axis->least, most = axis->most;
	if (!(least <= most))
		least = most = 0;
	if (axis->logarithmic) {
		double room = pow(most / least, 0.03);
		fprintf(script, "set logscale %s 10\nset format %s '10^{%%T}'\nset %srange [%.9g:%.9g]\n", which, which, which,
				least / room, most * room);
	} else {
		double room =
			most - least > 1e-9 * fmax(fabs(least), fabs(most)) ? 0.03 * (most - least) : fmax(fabs(most) * 0.1, 1e-9);
		fprintf(script, "set %srange [%.15g:%.15g]\n", which, least - room, most + room);
	}
	fprintf(script, "set %slabel ", which);
	picture_text(script, axis->label);
	fputc('\n', script);
}

void picture_terminal(FILE *script, int height)
{
	fprintf(script,
			"reset session\nset encoding utf8\n"
			"set terminal svg enhanced size %d,%d font 'sans-serif,%d' rounded\n"
			"set border 3 lw 0.8\nset tics nomirror scale 0.6\nset grid lw 0.6 lc rgb 'gray'\n"
			"unset key\n"
			"set xlabel noenhanced offset 0,0.3\nset ylabel noenhanced offset 0.8,0\n"
			"set tmargin 0.7\nset rmargin 2\n",
			PICTURE_WIDTH, height, PICTURE_FONT);
}

/* ---- data ---- */

/* The sample that stands for the k-th of `parts` stretches of n: a different place in each, so that no period hides. */
static size_t representative(size_t k, size_t parts, size_t n)
{
	if (parts >= n)
		return k;
	size_t first = (size_t)((double)k * (double)n / (double)parts);
	size_t behind = (size_t)((double)(k + 1) * (double)n / (double)parts);
	size_t width = behind > first ? behind - first : 1;
	return first + (size_t)((k * 2654435761u >> 7) % width);
}

struct block {
	const double *x, *y, *minus; /* y − minus is drawn; minus may be NULL */
	const char *name;
};

/* Writes `$name << E … E` and widens both axes. */
static void put_block(FILE *script, const struct block *block, size_t n, size_t points, struct axis *x, struct axis *y)
{
	size_t parts = n < points ? n : points;
	fprintf(script, "$%s << E\n", block->name);
	for (size_t k = 0; k < parts; k++) {
		size_t i = representative(k, parts, n);
		double at = block->x[i] / x->scale, value = (block->y[i] - (block->minus ? block->minus[i] : 0)) / y->scale;
		if (!isfinite(at) || !isfinite(value) || (x->logarithmic && at <= 0) || (y->logarithmic && value <= 0))
			continue;
		widen(x, at);
		widen(y, value);
		fprintf(script, "%.7g %.6g\n", at, value);
	}
	fputs("E\n", script);
}

static double residual_size(const tactus_trace *t)
{
	double most = 0;
	for (size_t i = 0; i < t->n; i++)
		if (isfinite(t->measured[i] - t->base[i]))
			most = fmax(most, fabs(t->measured[i] - t->base[i]));
	return most;
}

static struct axis residual_axis(const tactus_trace *t)
{
	return new_axis("residual", t->unit, residual_size(t));
}

static double dot(size_t n)
{
	return n > 1000 ? 0.18 : n > 300 ? 0.28 : 0.4;
}

/* ---- residual over time: before above, after below, on the same scale ---- */

static void time_picture(FILE *script, const struct pictures *pictures, const struct picture *picture)
{
	const tactus_trace *t = picture->trace;
	struct axis x = time_axis(pictures, t->time_s, t->n), y = residual_axis(t);
	bool after = series_extended(picture->series) && t->extended;
	size_t points = pictures->points * 3 / 4;
	picture_terminal(script, after ? 400 : 260);
	put_block(script, &(struct block){t->time_s, t->measured, t->base, "before"}, t->n, points, &x, &y);
	if (after)
		put_block(script, &(struct block){t->time_s, t->measured, t->extended, "after"}, t->n, points, &x, &y);
	put_axis(script, "x", &x);
	put_axis(script, "y", &y);
	fputs("set lmargin 9\n", script);
	double size = dot(t->n < points ? t->n : points);
	if (after)
		fputs("set multiplot layout 2,1\nset xlabel\n", script);
	fprintf(script, "plot 0 lw 0.8 lc rgb 'black', $before with points pt 7 ps %g lc rgb '%s'\n", size, COLOUR_BEFORE);
	if (!after)
		return;
	put_axis(script, "x", &x);
	fprintf(script,
			"plot 0 lw 0.8 lc rgb 'black', $after with points pt 7 ps %g lc rgb '%s'\n"
			"unset multiplot\n",
			size, COLOUR_AFTER);
}

/* ---- residual against the covariate ---- */

/* Means of y − minus in equal parts of the axis; parts with few samples say nothing. */
static void put_means(FILE *script, const struct block *block, size_t n, const struct axis *x, const struct axis *y)
{
	enum { PARTS = 28, LEAST = 4 };
	double sum[PARTS] = {0}, at[PARTS] = {0}, low = x->least, high = x->most;
	size_t count[PARTS] = {0};
	for (size_t i = 0; i < n; i++) {
		double where = block->x[i] / x->scale, value = (block->y[i] - block->minus[i]) / y->scale;
		if (!isfinite(where) || !isfinite(value) || (x->logarithmic && where <= 0))
			continue;
		double share = x->logarithmic ? log(where / low) / log(high / low) : (where - low) / (high - low);
		size_t k = share > 0 && share < 1 ? (size_t)(share * PARTS) : share >= 1 ? PARTS - 1 : 0;
		sum[k] += value;
		at[k] += where;
		count[k]++;
	}
	fprintf(script, "$%s << E\n", block->name);
	size_t written = 0;
	for (size_t k = 0; k < PARTS; k++)
		if (count[k] >= LEAST) {
			fprintf(script, "%.7g %.6g\n", at[k] / (double)count[k], sum[k] / (double)count[k]);
			written++;
		}
	if (!written)
		fputs("NaN NaN\n", script);
	fputs("E\n", script);
}

static void covariate_picture(FILE *script, const struct pictures *pictures, const struct picture *picture)
{
	const tactus_trace *t = picture->trace;
	bool is_time = strcmp(t->covariate_name, "time_s") == 0;
	struct axis x =
		is_time ? time_axis(pictures, t->covariate, t->n) : column_axis(t->covariate_name, NULL, t->covariate, t->n);
	struct axis y = residual_axis(t);
	bool after = series_extended(picture->series) && t->extended;
	if (!is_time)
		perhaps_logarithmic(&x, t->covariate, t->n, 100);
	picture_terminal(script, 330);
	put_block(script, &(struct block){t->covariate, t->measured, t->base, "dots"}, t->n, pictures->points, &x, &y);
	if (after)
		put_block(script, &(struct block){t->covariate, t->extended, t->base, "effect"}, t->n, pictures->points, &x,
				  &y);
	put_means(script, &(struct block){t->covariate, t->measured, t->base, "before"}, t->n, &x, &y);
	if (after)
		put_means(script, &(struct block){t->covariate, t->measured, t->extended, "after"}, t->n, &x, &y);
	put_axis(script, "x", &x);
	put_axis(script, "y", &y);
	double size = dot(t->n < pictures->points ? t->n : pictures->points);
	fprintf(script, "plot 0 lw 0.8 lc rgb 'black', $dots with points pt 7 ps %g lc rgb '%s'", size, COLOUR_MEASURED);
	if (after)
		fprintf(script, ", $effect with points pt 7 ps %g lc rgb '%s'", size, COLOUR_EFFECT);
	fprintf(script, ", $before with linespoints pt 7 ps 0.4 lw 2 lc rgb '%s'", COLOUR_BEFORE);
	if (after)
		fprintf(script, ", $after with linespoints pt 7 ps 0.4 lw 2 lc rgb '%s'", COLOUR_AFTER);
	fputc('\n', script);
}

/* ---- output against input ---- */

static void curve_picture(FILE *script, const struct pictures *pictures, const struct picture *picture)
{
	const tactus_trace *t = picture->trace;
	struct axis x = column_axis(t->input, t->input_unit, t->x, t->n);
	struct axis y = column_axis(t->output, t->unit, t->measured, t->n);
	bool after = series_extended(picture->series) && t->extended;
	size_t points = pictures->points * 2 / 3;
	perhaps_logarithmic(&x, t->x, t->n, 100);
	if (x.logarithmic)
		perhaps_logarithmic(&y, t->measured, t->n, 100);
	picture_terminal(script, 360);
	put_block(script, &(struct block){t->x, t->measured, NULL, "measured"}, t->n, points, &x, &y);
	put_block(script, &(struct block){t->x, t->base, NULL, "base"}, t->n, points, &x, &y);
	if (after)
		put_block(script, &(struct block){t->x, t->extended, NULL, "extended"}, t->n, points, &x, &y);
	put_axis(script, "x", &x);
	put_axis(script, "y", &y);
	double size = dot(t->n < points ? t->n : points);
	fprintf(script,
			"plot $measured with points pt 7 ps %g lc rgb '%s', "
			"$base with points pt 7 ps %g lc rgb '%s'",
			1.8 * size, COLOUR_MEASURED, size, COLOUR_BEFORE);
	if (after)
		fprintf(script, ", $extended with points pt 7 ps %g lc rgb '%s'", size, COLOUR_AFTER);
	fputc('\n', script);
}

/* ---- what is left: spectrum and autocorrelation ---- */

static void before_after_picture(FILE *script, const struct picture *picture, bool spectrum)
{
	const tactus_before_after *c = spectrum ? &picture->series->spectrum : &picture->series->autocorrelation;
	struct axis x = {.scale = 1, .least = INFINITY, .most = -INFINITY, .logarithmic = spectrum}, y = x;
	bool after = c->after && series_extended(picture->series);
	const char *label = c->x_label ? c->x_label : "", *unit = strstr(label, " / ");
	if (unit) /* "lag / s" as the other axes have it */
		snprintf(x.label, sizeof x.label, "%.*s (%.40s)", (int)(unit - label < 60 ? unit - label : 60), label,
				 unit + 3);
	else
		snprintf(x.label, sizeof x.label, "%.100s", label);
	snprintf(y.label, sizeof y.label, "%s", spectrum ? "power of the residual" : "autocorrelation");
	picture_terminal(script, 300);
	put_block(script, &(struct block){c->x, c->before, NULL, "before"}, c->n, c->n, &x, &y);
	if (after)
		put_block(script, &(struct block){c->x, c->after, NULL, "after"}, c->n, c->n, &x, &y);
	if (!(x.least <= x.most)) { /* nothing that a logarithm can show */
		x.least = y.least = 1;
		x.most = y.most = 10;
	}
	if (!spectrum)
		widen(&y, 0);
	put_axis(script, "x", &x);
	put_axis(script, "y", &y);
	fprintf(script, "plot %s $before with lines lw 1.4 lc rgb '%s'", spectrum ? "" : "0 lw 0.8 lc rgb 'black',",
			COLOUR_BEFORE);
	if (after)
		fprintf(script, ", $after with lines lw 1.4 lc rgb '%s'", COLOUR_AFTER);
	fputc('\n', script);
}

void picture_script(FILE *script, const struct pictures *pictures, const struct picture *picture)
{
	switch (picture->kind) {
	case PICTURE_TIME:
		time_picture(script, pictures, picture);
		break;
	case PICTURE_COVARIATE:
		covariate_picture(script, pictures, picture);
		break;
	case PICTURE_CURVE:
		curve_picture(script, pictures, picture);
		break;
	case PICTURE_EVIDENCE:
		picture_evidence(script, picture);
		break;
	case PICTURE_SPECTRUM:
		before_after_picture(script, picture, true);
		break;
	case PICTURE_AUTOCORRELATION:
		before_after_picture(script, picture, false);
		break;
	}
}
