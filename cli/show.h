/* The things that `tactus show` explains; each prints text, or JSON with --json, and returns an exit status. */
#ifndef TACTUS_CLI_SHOW_H
#define TACTUS_CLI_SHOW_H

#include "cli.h"

int cli_show_recording(const struct cli *cli, const char *file);
/* A model, a bench, a profile of a device or calibration loads. */
int cli_show_model(const struct cli *cli, const char *file);
/* True if an effect has that name. */
bool cli_show_effect_is(const char *name);
/* The catalogue, or one effect of it. */
int cli_show_effects(const struct cli *cli, const char *name);

/* "12.34 ± 0.05 N", with as many digits as the standard error (NaN: none) bears; written to text and returned. */
const char *cli_value_text(double value, double standard_error, const char *unit, char text[96]);
/* The unit that a column's name ends in; all of the name where it has none. */
const char *cli_unit_of(const char *column);

#endif
