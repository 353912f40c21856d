/* The person at a real bench, who applies the load of a protocol by hand: told what to apply, and when. */
#ifndef TACTUS_OPERATOR_H
#define TACTUS_OPERATOR_H

#include "cli.h"

struct cli_operator {
	tactus_protocol *protocol; /* NULL: nobody is told anything */
	double said_N, said_s;     /* the last load that was said, and when; NaN: none yet */
};

/* Reads --protocol for a device that runs by the clock; 0 or a tactus_error. */
int cli_operator_begin(struct cli_operator *person, const char *protocol);
/*
 * What to apply now, if that is another load than was said last ("apply 40 N"), written to text; false if there is
 * nothing new. A load that moves is said once a second at most.
 */
bool cli_operator_say(struct cli_operator *person, double time_s, char *text, size_t size);
void cli_operator_end(struct cli_operator *person);

#endif
