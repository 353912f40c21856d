/* The page of --report: pieces that its sections are written with. */
#ifndef TACTUS_CLI_HTML_H
#define TACTUS_CLI_HTML_H

#include "picture.h"

struct html {
	FILE *out;
	const struct cli *cli;
	const tactus_diagnosis *diagnosis;
	const struct pictures *pictures;
};

/* Head and style sheet, up to <body>. */
void html_head(const struct html *html, const char *title);
/* Text with <, >, & and quotes made harmless. NULL: nothing. */
void html_text(const struct html *html, const char *text);
/* <tag>text</tag> */
void html_element(const struct html *html, const char *tag, const char *text);
/* A table that scrolls where the page is narrow; columns separated by '|', those that begin with '#' hold numbers. */
void html_table_begin(const struct html *html, const char *id, size_t series, const char *columns);
void html_table_end(const struct html *html);
/*
 * A cell with a number: shown as people read it; in data-value the shortest text of the number, as in the JSON, and in
 * data-json where it stands there, as a jq path.
 */
void html_number(const struct html *html, double value, const char *shown, const char *path, ...) TACTUS_PRINTF(4, 5);
/* The same in running text. */
void html_inline(const struct html *html, double value, const char *shown, const char *path, ...) TACTUS_PRINTF(4, 5);
void html_cell(const struct html *html, const char *text);
/* The pictures of one kind that a series has (all its outputs), each with its caption. */
void html_pictures(const struct html *html, const tactus_diagnosed *series, enum picture_kind kind);

/* The section of one series. */
void html_series(const struct html *html, size_t index);

#endif
