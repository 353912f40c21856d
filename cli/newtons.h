/* Whether a model made a force of any reading; of none, what was missing is said once, at the end. */
#ifndef TACTUS_CLI_NEWTONS_H
#define TACTUS_CLI_NEWTONS_H

#include "cli.h"

struct cli_newtons {
	const tactus_model *model;
	bool rows, force; /* whether there were any */
	unsigned found;   /* bit i: a row had the i-th reading that the model needs */
};

/* Looks at a block that has its estimates. */
void cli_newtons_see(struct cli_newtons *newtons, const tactus_table *block);
void cli_newtons_note(const struct cli *cli, const struct cli_newtons *newtons);

#endif
