/* What gnuplot drew → SVG inside a page: its own ids and colours go, thousands of points become one path. */
#include <stdlib.h>
#include <string.h>

#include "picture.h"

struct line {
	const char *text;
	size_t length;
};

static bool next_line(const char **from, const char *end, struct line *line)
{
	if (*from >= end)
		return false;
	const char *stop = memchr(*from, '\n', (size_t)(end - *from));
	line->text = *from;
	line->length = (size_t)((stop ? stop : end) - *from);
	*from = stop ? stop + 1 : end;
	return true;
}

static bool begins(const struct line *line, const char *what)
{
	size_t length = strlen(what);
	return line->length >= length && memcmp(line->text, what, length) == 0;
}

/* ---- colours ---- */

/* Names of the page's style sheet for the colours of picture.h. */
static const struct {
	const char *hex, *variable;
} colours[] = {
	{COLOUR_BEFORE, "before"},     {COLOUR_AFTER, "after"}, {COLOUR_EFFECT, "effect"},
	{COLOUR_MEASURED, "measured"}, {COLOUR_DIM, "dim"},     {COLOUR_BAR, "bar"},
};

static void put_colour(FILE *out, int red, int green, int blue)
{
	char hex[16];
	snprintf(hex, sizeof hex, "#%02x%02x%02x", (unsigned)red & 255, (unsigned)green & 255, (unsigned)blue & 255);
	for (size_t i = 0; i < sizeof colours / sizeof *colours; i++)
		if (strcmp(colours[i].hex, hex) == 0) {
			fprintf(out, "var(--%s)", colours[i].variable);
			return;
		}
	fputs(red || green || blue ? hex : "currentColor", out);
}

/* ---- lines ---- */

static const struct {
	const char *from, *to;
} replacements[] = {
	{" color=\"black\"", ""},
	{" color=\"gray\"", ""},
	{"\"black\"", "\"currentColor\""},
	{"'black'", "'currentColor'"},
	{"'gray'", "'var(--grid)'"},
	{"\"gray\"", "\"var(--grid)\""},
	{" font-family=\"sans-serif\"", ""},
	{" class=\"gridline\"", ""},
	{" stroke-linecap=\"round\"", ""},
	{" stroke-linejoin=\"round\"", ""},
};

static void put_line(FILE *out, const struct line *line)
{
	const char *end = line->text + line->length;
	for (const char *c = line->text; c < end;) {
		int red, green, blue, used = 0;
		if (*c == 'r' && sscanf(c, "rgb( %d , %d , %d )%n", &red, &green, &blue, &used) == 3 && used) {
			put_colour(out, red, green, blue);
			c += used;
			continue;
		}
		size_t i = 0, length = 0;
		for (; i < sizeof replacements / sizeof *replacements; i++) {
			length = strlen(replacements[i].from);
			if ((size_t)(end - c) >= length && memcmp(c, replacements[i].from, length) == 0)
				break;
		}
		if (i < sizeof replacements / sizeof *replacements) {
			fputs(replacements[i].to, out);
			c += length;
		} else {
			fputc(*c++, out);
		}
	}
	fputc('\n', out);
}

/* ---- points ---- */

struct point {
	double x, y, radius;
	int red, green, blue;
};

static bool read_point(const struct line *line, struct point *point)
{
	char text[160];
	if (!begins(line, "\t<use xlink:href='#gpPt6'") || line->length >= sizeof text)
		return false;
	memcpy(text, line->text, line->length);
	text[line->length] = '\0';
	return sscanf(text,
				  "\t<use xlink:href='#gpPt6' transform='translate(%lf,%lf) scale(%lf)' color='rgb( %d , %d , %d )'",
				  &point->x, &point->y, &point->radius, &point->red, &point->green, &point->blue) == 6;
}

/* A point is a stroke without length and with a round end: 14 bytes instead of 110. */
static bool put_points(FILE *out, const struct line *first, const char **from, const char *end)
{
	struct point point, next;
	if (!read_point(first, &point))
		return false;
	fprintf(out, "<path stroke-width='%.2f' stroke-linecap='round' stroke='", 2 * point.radius);
	put_colour(out, point.red, point.green, point.blue);
	fprintf(out, "' d='M%.1f %.1fh0", point.x, point.y);
	for (;;) {
		const char *ahead = *from;
		struct line line;
		if (!next_line(&ahead, end, &line) || !read_point(&line, &next) || next.red != point.red ||
			next.green != point.green || next.blue != point.blue || next.radius < point.radius ||
			next.radius > point.radius)
			break;
		fprintf(out, "M%.1f %.1fh0", next.x, next.y);
		*from = ahead;
	}
	fputs("'/>\n", out);
	return true;
}

/* ---- the whole ---- */

/* "<g …>" with nothing inside: gnuplot writes dozens. */
static bool skip_empty_group(const struct line *line, const char **from, const char *end)
{
	const char *ahead = *from;
	struct line next;
	if (!begins(line, "<g ") || !next_line(&ahead, end, &next) || next.length != 4 || !begins(&next, "</g>"))
		return false;
	*from = ahead;
	return true;
}

static void put_escaped(FILE *out, const char *text)
{
	for (; *text; text++)
		if (strchr("<>&\"", *text))
			fprintf(out, "&#%d;", *text);
		else
			fputc(*text, out);
}

void svg_inline(FILE *out, const char *drawn, size_t length, const char *title)
{
	const char *end = drawn + length, *from = drawn;
	struct line line;
	bool inside = false;
	int width = PICTURE_WIDTH, height = PICTURE_WIDTH;
	while (next_line(&from, end, &line)) {
		if (!inside) {
			if (begins(&line, " viewBox="))
				sscanf(line.text, " viewBox=\"0 0 %d %d\"", &width, &height);
			inside = begins(&line, "<g id=\"gnuplot_canvas\"");
			if (!inside)
				continue;
			fprintf(out, "<svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"", width, height);
			put_escaped(out, title);
			fputs("\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n<g>\n", out);
		} else if (begins(&line, "<defs>")) {
			while (!begins(&line, "</defs>") && next_line(&from, end, &line))
				;
		} else if (begins(&line, "\t<g id=\"gnuplot_plot_")) {
			fputs("<g>\n", out);
		} else if (line.length && !begins(&line, "<rect x=\"0\" y=\"0\"") && !skip_empty_group(&line, &from, end) &&
				   !put_points(out, &line, &from, end)) {
			put_line(out, &line);
		}
		if (begins(&line, "</svg>"))
			return;
	}
}
