/* Serial ports: opened raw, and found again by what is plugged in, not by name. */
#ifndef TACTUS_PORT_H
#define TACTUS_PORT_H

#include <stdbool.h>
#include <stddef.h>

/* As /sys has it. Where the adapter has no serial number, it is the one in that socket. Empty: not on USB. */
typedef struct {
	char path[256];             /* as it was opened */
	char vendor[8], product[8]; /* four hexadecimal digits */
	char serial[128];           /* "" if it has none */
	char interface[8];          /* of adapters with several ports */
	char socket[64];            /* bus and ports on the way, `1-4.2` */
} tactus_port_identity;

/* Never fails: what cannot be known is empty. */
void tactus_port_identify(const char *path, tactus_port_identity *identity);
/* Where it is now: the path is written; false if it is not there. Without USB that is where it was. */
bool tactus_port_find(const tactus_port_identity *identity, char *path, size_t size);

/*
 * Opens a port (8N1, raw, no flow control) and says what it is; returns the descriptor. TACTUS_ERR_DEVICE,
 * TACTUS_ERR_PERMISSION (with the group to join), TACTUS_ERR_ARGUMENT for a baud rate that it does not do. A terminal
 * that is no serial port (a pty) is opened as it is.
 */
int tactus_port_open(const char *name, int baud, tactus_port_identity *identity);
/* The same adapter again, under whatever name it has now. TACTUS_ERR_LOST if it is not there. */
int tactus_port_reopen(const tactus_port_identity *identity, int baud);
/* "/dev/ttyACM0 (usb 2341:0043 SERIAL)", or the name alone: what a recording says. */
void tactus_port_describe(const tactus_port_identity *identity, char *text, size_t size);
/* Calls found for every serial port with hardware behind it; one that may not be opened is described with the remedy.
 * False if found returned false. */
bool tactus_port_list(bool (*found)(void *context, const char *name, const char *description), void *context);

#endif
