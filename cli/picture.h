/* Pictures: gnuplot draws them, what it wrote becomes SVG that can stand inside a page, light or dark. */
#ifndef TACTUS_CLI_PICTURE_H
#define TACTUS_CLI_PICTURE_H

#include "diagnose.h"

enum { PICTURE_WIDTH = 480, PICTURE_FONT = 14 };

/* Colours by what they mean; the page's style sheet gives each a light and a dark tone. */
#define COLOUR_BEFORE "#d55e00"
#define COLOUR_AFTER "#0072b2"
#define COLOUR_EFFECT "#009e73"
#define COLOUR_MEASURED "#808080"
#define COLOUR_DIM "#a0a0a0"
#define COLOUR_BAR "#8fb4cc"

enum picture_kind {
	PICTURE_TIME,
	PICTURE_CURVE,
	PICTURE_COVARIATE,
	PICTURE_EVIDENCE,
	PICTURE_SPECTRUM,
	PICTURE_AUTOCORRELATION
};

struct picture {
	enum picture_kind kind;
	const tactus_diagnosed *series;
	const tactus_trace *trace; /* NULL for those that belong to the series */
	const char *drawn;         /* gnuplot's SVG, not terminated */
	size_t length;
};

struct pictures {
	struct picture *list;
	size_t count;
	size_t points; /* at most so many in one picture */
	bool clock;    /* time_s is seconds, not a sample number */
	char *svg;     /* all of them */
};

/* Which pictures this diagnosis has; false if memory ran out. */
bool pictures_choose(struct pictures *pictures, const tactus_diagnosis *diagnosis);
/* The script of one picture, data included. */
void picture_script(FILE *script, const struct pictures *pictures, const struct picture *picture);
/* What several scripts begin with: a clean gnuplot, a size; and text in its single quotes. */
void picture_terminal(FILE *script, int height);
void picture_text(FILE *script, const char *text);
void picture_evidence(FILE *script, const struct picture *picture);
/* Draws all of them; an exit status. */
int pictures_draw(const struct cli *cli, struct pictures *pictures);
void pictures_free(struct pictures *pictures);

/* Runs gnuplot on a script in a file that is read from its beginning; what it prints is to be freed. */
int gnuplot_run(const struct cli *cli, FILE *script, char **printed);
/* One drawing of gnuplot as an <svg> element that takes the width it is given. */
void svg_inline(FILE *out, const char *drawn, size_t length, const char *title);

/* True where the extended model differs from the base: there is an "after". */
bool series_extended(const tactus_diagnosed *series);

#endif
