/* The person at a real bench. */
#include <math.h>
#include <stdio.h>

#include "operator.h"

/* A load that differs by less than this share of the largest is the same. */
#define SAME_SHARE 0.005
#define PAUSE_S 1.0

int cli_operator_begin(struct cli_operator *person, const char *protocol)
{
	*person = (struct cli_operator){.said_N = NAN, .said_s = -INFINITY};
	return protocol ? tactus_protocol_parse(protocol, 1, &person->protocol) : 0;
}

bool cli_operator_say(struct cli_operator *person, double time_s, char *text, size_t size)
{
	if (!person->protocol || time_s > tactus_protocol_duration_s(person->protocol))
		return false;
	const double load_N = tactus_protocol_force_N(person->protocol, time_s);
	const double same_N = SAME_SHARE * tactus_protocol_maximum_N(person->protocol);
	if (fabs(load_N - person->said_N) <= same_N || time_s - person->said_s < PAUSE_S)
		return false;
	snprintf(text, size, "apply %.3g N", load_N);
	person->said_N = load_N;
	person->said_s = time_s;
	return true;
}

void cli_operator_end(struct cli_operator *person)
{
	tactus_protocol_free(person->protocol);
	person->protocol = NULL;
}
