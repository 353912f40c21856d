/* The two halves of `tactus convert`. */
#ifndef TACTUS_CLI_CONVERT_H
#define TACTUS_CLI_CONVERT_H

#include "cli.h"

/* What the command line says of the circuit. */
tactus_convert_options cli_convert_options(const struct cli *cli);
/* `--waveform`: raw samples are demodulated, then converted. Returns an exit status. */
int cli_convert_waveform(const struct cli *cli, const char *recording);

#endif
