/* The page of --report: text, tables, pictures. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "html.h"

/* ---- text ---- */

void html_text(const struct html *html, const char *text)
{
	for (; text && *text; text++) {
		if (strchr("<>&\"'", *text))
			fprintf(html->out, "&#%d;", *text);
		else
			fputc(*text, html->out);
	}
}

void html_element(const struct html *html, const char *tag, const char *text)
{
	fprintf(html->out, "<%s>", tag);
	html_text(html, text);
	fprintf(html->out, "</%.*s>\n", (int)strcspn(tag, " "), tag);
}

/* ---- tables ---- */

void html_table_begin(const struct html *html, const char *id, size_t series, const char *columns)
{
	fprintf(html->out, "<div class=\"scroll\"><table id=\"%s-%zu\"><thead><tr>", id, series);
	while (*columns) {
		size_t length = strcspn(columns, "|");
		bool number = *columns == '#';
		fprintf(html->out, "<th scope=\"col\"%s>%.*s</th>", number ? " class=\"number\"" : "", (int)length - number,
				columns + number);
		columns += length + (columns[length] == '|');
	}
	fputs("</tr></thead><tbody>\n", html->out);
}

void html_table_end(const struct html *html)
{
	fputs("</tbody></table></div>\n", html->out);
}

static void number(const struct html *html, const char *tag, double value, const char *shown, const char *path,
				   va_list values)
{
	char text[TACTUS_NUMBER_SIZE] = "";
	if (isfinite(value))
		tactus_format_number(value, text);
	fprintf(html->out, "<%s class=\"number\" data-json=\"", tag);
	vfprintf(html->out, path, values);
	fprintf(html->out, "\" data-value=\"%s\">", text);
	html_text(html, shown);
	fprintf(html->out, "</%s>", tag);
}

void html_number(const struct html *html, double value, const char *shown, const char *path, ...)
{
	va_list values;
	va_start(values, path);
	number(html, "td", value, shown, path, values);
	va_end(values);
}

void html_inline(const struct html *html, double value, const char *shown, const char *path, ...)
{
	va_list values;
	va_start(values, path);
	number(html, "span", value, shown, path, values);
	va_end(values);
}

void html_cell(const struct html *html, const char *text)
{
	fputs("<td>", html->out);
	html_text(html, text);
	fputs("</td>", html->out);
}

/* ---- pictures ---- */

static const char *const titles[] = {
	[PICTURE_TIME] = "Residual over time",           [PICTURE_COVARIATE] = "Residual against what shows it",
	[PICTURE_CURVE] = "Output against input",        [PICTURE_EVIDENCE] = "Evidence for every candidate",
	[PICTURE_SPECTRUM] = "Spectrum of the residual", [PICTURE_AUTOCORRELATION] = "Autocorrelation of the residual",
};

/* What a colour stands for; those of the extended model only where there is one. */
struct legend {
	const char *colour, *text, *alone; /* alone: where there is no extended model; NULL: not there then */
};

static const struct legend before_after[] = {{"before", "before", "measured minus simulated"},
											 {"after", "after", NULL}};
static const struct legend curve[] = {
	{"measured", "measured", "measured"}, {"before", "base model", "base model"}, {"after", "extended model", NULL}};
static const struct legend covariate[] = {{"measured", "measured − base model", "measured − base model"},
										  {"effect", "what the extended model adds", NULL},
										  {"before", "mean before", "mean"},
										  {"after", "mean after", NULL}};
static const struct legend evidence[] = {{"after", "named as a cause", NULL}, {"bar", "others tried", "tried"}};

static const struct {
	const struct legend *legend;
	size_t n;
	const char *caption;
} explanations[] = {
	[PICTURE_TIME] = {before_after, 2, "Both parts have the same scale."},
	[PICTURE_CURVE] = {curve, 3, "All at the same instants."},
	[PICTURE_COVARIATE] = {covariate, 4, "What is explained leaves a mean of zero."},
	[PICTURE_EVIDENCE] = {evidence, 2,
						  "Each effect alone, added to the refitted base model; logarithmic beyond 10. What is in grey "
						  "could not be tested."},
	[PICTURE_SPECTRUM] = {before_after, 2, "What is noise alone has no peaks and no slope that the noise has not."},
	[PICTURE_AUTOCORRELATION] = {before_after, 2, "White noise falls to zero at once and stays there."},
};

static void put_legend(const struct html *html, enum picture_kind kind, bool extended)
{
	fputs("<p class=\"legend\">", html->out);
	for (size_t i = 0; i < explanations[kind].n; i++) {
		const struct legend *legend = &explanations[kind].legend[i];
		const char *text = extended ? legend->text : legend->alone;
		if (text)
			fprintf(html->out, "<span><i style=\"background:var(--%s)\"></i>%s</span> ", legend->colour, text);
	}
	fputs("</p>\n", html->out);
}

void html_pictures(const struct html *html, const tactus_diagnosed *series, enum picture_kind kind)
{
	for (size_t i = 0; i < html->pictures->count; i++) {
		const struct picture *picture = &html->pictures->list[i];
		if (picture->series != series || picture->kind != kind)
			continue;
		char name[64], title[160];
		bool several = picture->trace && series->trace_count > 1;
		snprintf(title, sizeof title, "%s%s%s", titles[kind], several ? ": " : "",
				 several ? cli_quantity_name(picture->trace->output, name) : "");
		fputs("<figure>\n", html->out);
		html_element(html, "h4", title);
		svg_inline(html->out, picture->drawn, picture->length, title);
		bool extended = series_extended(series);
		fputs("<figcaption>", html->out);
		put_legend(html, kind, extended);
		if (extended || kind >= PICTURE_EVIDENCE)
			html_element(html, "p", explanations[kind].caption);
		fputs("</figcaption>", html->out);
		fputs("</figure>\n", html->out);
	}
}
