/* Any text as a protocol: the load is a number at every instant and never above what the protocol says is its most. */
#include <math.h>
#include <string.h>

#include "fuzz.h"

enum { INSTANTS = 200, LENGTH_MAX = 4096 };

static void apply(const tactus_protocol *protocol)
{
	double duration_s = tactus_protocol_duration_s(protocol), most = tactus_protocol_maximum_N(protocol);
	FUZZ_HOLDS(duration_s >= 0 && isfinite(most));
	for (int i = -1; i <= INSTANTS + 1; i++) {
		double force_N = tactus_protocol_force_N(protocol, duration_s * i / INSTANTS);
		FUZZ_HOLDS(isfinite(force_N));
		FUZZ_HOLDS(force_N <= most + 1e-9 * fabs(most));
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	char text[LENGTH_MAX + 1];
	tactus_protocol *protocol;
	if (size > LENGTH_MAX)
		return 0;
	memcpy(text, data, size);
	text[size] = '\0';
	if (tactus_protocol_parse(text, 1, &protocol) == 0) {
		apply(protocol);
		tactus_protocol_free(protocol);
	} else {
		FUZZ_HOLDS(*tactus_error_message());
	}
	return 0;
}
