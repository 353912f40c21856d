/* What `tactus diagnose` prints: JSON, a page in the terminal, a page in HTML. */
#ifndef TACTUS_CLI_DIAGNOSE_H
#define TACTUS_CLI_DIAGNOSE_H

#include "cli.h"

extern const struct cli_command cli_diagnose;

/* CONTRACT §4, on out; `extended` is the path of the extended model, NULL where none was written. */
void cli_diagnose_json(FILE *out, const tactus_diagnosis *diagnosis, const char *extended);
/* The page of about a dozen lines. */
/* extended: the file that holds the extended model, or NULL. */
void cli_diagnose_text(FILE *out, const struct cli *cli, const tactus_diagnosis *diagnosis, const char *extended);
/* Writes index.html into the directory, which is made if it is not there; `first` is the first recording. A status. */
int cli_diagnose_report(const struct cli *cli, const tactus_diagnosis *diagnosis, const tactus_table *first,
						const char *directory);

/* The command line as it was given, quoted for a shell, with `extra` in place of what it asks to be written. */
void cli_diagnose_command(FILE *out, const struct cli *cli, const char *extra);
/* The same without what is to be written, and `--overwrite` where the original would refuse to run twice. */
void cli_diagnose_again(FILE *out, const struct cli *cli);

/* ---- what the three have in common ---- */

/* "1.1 µS", "0.13", "4.1×10⁻⁷ S/N": `digits` significant ones, SI prefixes where the unit is one symbol; NaN: "–". */
const char *cli_si(double value, const char *unit, int digits, char text[64]);
/* The same with the prefix that suits `like`, so that two numbers can be compared. */
const char *cli_si_like(double value, double like, const char *unit, int digits, char text[64]);
/* The power of ten of the SI prefix that suits the value, and "µS" for it; 0 and the plain unit where none does. */
int cli_si_prefix(double value, const char *unit, char text[32]);
/* "12.3 ± 0.4 pF", as many digits as the standard error bears. */
const char *cli_si_error(double value, double standard_error, const char *unit, char text[96]);
/* "63 %" of 0.63; 99.95 % and above only where it is 100 %. */
const char *cli_percent(double share, char text[32]);
/* The share of what can be explained: "93 %"; "all", where the error is at its estimate of the noise, or below. */
const char *cli_of_explainable(double share, char text[32]);
/* The error in newtons once extended, of a series that has one before; in words where it is not known. */
const char *cli_force_after(const tactus_diagnosed *series, int digits, char text[96]);
/* How large the error is beside the noise floor: "1.1 ×", "31 ×". */
const char *cli_of_noise(const tactus_base_error *base, char text[32]);
/* "−6944": a whole number where that is large, with a true minus sign. */
const char *cli_bic(double delta_bic, char text[32]);
/* "strong", in the words of Kass and Raftery (1995), Table in §3.2, for twice the log of the odds. */
const char *cli_bic_word(double delta_bic);
/* "conductance" of "conductance_S": a column's quantity, spaces for underscores. */
const char *cli_quantity_name(const char *column, char text[64]);
/* "S" of "conductance_S", "" where the name ends in no unit. */
const char *cli_column_unit(const char *column);
/* What is printed of a verdict: "cause found". */
const char *cli_verdict_words(enum tactus_verdict verdict);
/* The base error that says most: the largest share of its noise floor; NULL where there is none. */
const tactus_base_error *cli_worst_base(const tactus_diagnosed *series);
/* Why the error in newtons does not fall; NULL where it does. */
const char *cli_no_force_gain(const tactus_diagnosed *series);

#endif
