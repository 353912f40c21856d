/* Which pictures a diagnosis has, and drawing all of them at once. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "picture.h"

bool series_extended(const tactus_diagnosed *series)
{
	return series->gain || series->cause_count;
}

static size_t finite_pairs(const double *x, const double *y, size_t n)
{
	size_t pairs = 0;
	for (size_t i = 0; x && y && i < n; i++)
		pairs += isfinite(x[i]) && isfinite(y[i]);
	return pairs;
}

static void choose(struct pictures *pictures, enum picture_kind kind, const tactus_diagnosed *series,
				   const tactus_trace *trace, bool there)
{
	if (there)
		pictures->list[pictures->count++] = (struct picture){.kind = kind, .series = series, .trace = trace};
}

static void choose_trace(struct pictures *pictures, const tactus_diagnosed *series, const tactus_trace *t)
{
	enum { LEAST = 3 };
	bool outputs = finite_pairs(t->measured, t->base, t->n) >= LEAST;
	choose(pictures, PICTURE_TIME, series, t, outputs && finite_pairs(t->time_s, t->measured, t->n) >= LEAST);
	choose(pictures, PICTURE_COVARIATE, series, t,
		   outputs && t->covariate_name && finite_pairs(t->covariate, t->measured, t->n) >= LEAST);
	choose(pictures, PICTURE_CURVE, series, t, outputs && finite_pairs(t->x, t->measured, t->n) >= LEAST);
}

bool pictures_choose(struct pictures *pictures, const tactus_diagnosis *diagnosis)
{
	enum { POINTS = 2000, POINTS_MIN = 400, PER_TRACE = 3, PER_SERIES = 3 };
	size_t most = 0, traces = 0;
	for (size_t i = 0; i < diagnosis->series_count; i++) {
		most += PER_SERIES + PER_TRACE * diagnosis->series[i].trace_count;
		traces += diagnosis->series[i].trace_count;
	}
	/* The page stays below one or two megabytes with many channels as well. */
	pictures->points = traces > 2 ? 2 * POINTS / traces : POINTS;
	if (pictures->points < POINTS_MIN)
		pictures->points = POINTS_MIN;
	pictures->list = calloc(most + 1, sizeof *pictures->list);
	for (size_t i = 0; pictures->list && i < diagnosis->series_count; i++) {
		const tactus_diagnosed *series = &diagnosis->series[i];
		for (size_t t = 0; t < series->trace_count; t++)
			choose_trace(pictures, series, &series->traces[t]);
		choose(pictures, PICTURE_EVIDENCE, series, NULL, series->candidate_count > 0);
		choose(pictures, PICTURE_SPECTRUM, series, NULL, series->spectrum.n > 2);
		choose(pictures, PICTURE_AUTOCORRELATION, series, NULL, series->autocorrelation.n > 2);
	}
	return pictures->list != NULL;
}

/* Cuts what gnuplot printed into its documents; false if there are not as many as were asked for. */
static bool cut(struct pictures *pictures)
{
	static const char opening[] = "<?xml";
	const char *at = strstr(pictures->svg, opening);
	for (size_t i = 0; i < pictures->count; i++) {
		if (!at)
			return false;
		const char *next = strstr(at + 1, opening);
		pictures->list[i].drawn = at;
		pictures->list[i].length = next ? (size_t)(next - at) : strlen(at);
		at = next;
	}
	return !at;
}

int pictures_draw(const struct cli *cli, struct pictures *pictures)
{
	if (!pictures->count)
		return CLI_OK;
	int fd = memfd_create("script", MFD_CLOEXEC);
	FILE *script = fd >= 0 ? fdopen(fd, "w+") : NULL;
	if (!script)
		return cli_error(cli, CLI_FAILED, "the script of the pictures: %s", strerror(errno));
	for (size_t i = 0; i < pictures->count; i++)
		picture_script(script, pictures, &pictures->list[i]);
	int status = gnuplot_run(cli, script, &pictures->svg);
	fclose(script);
	if (!status && !cut(pictures))
		status = cli_error(cli, CLI_FAILED, "gnuplot drew fewer pictures than it was asked for");
	return status;
}

void pictures_free(struct pictures *pictures)
{
	free(pictures->list);
	free(pictures->svg);
}
