/* Which serial adapter a port is, so that it is found again under another name. */
#ifndef TACTUS_SERIAL_PORT_H
#define TACTUS_SERIAL_PORT_H

#include <stdbool.h>
#include <stddef.h>

/* As /sys has it. Where the adapter has no serial number, it is the one in that socket. Empty: not on USB. */
typedef struct {
	char path[256];             /* as it was opened */
	char vendor[8], product[8]; /* four hexadecimal digits */
	char serial[128];           /* "" if it has none */
	char interface[8];          /* of adapters with several ports */
	char socket[64];            /* bus and ports on the way, `1-4.2` */
} tactus_serial_identity;

/* Never fails: what cannot be known is empty. */
void tactus_serial_identify(const char *path, tactus_serial_identity *identity);
/* Where it is now: the path is written; false if it is not there. Without USB that is where it was. */
bool tactus_serial_find(const tactus_serial_identity *identity, char *path, size_t size);

#endif
