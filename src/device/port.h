/* Serial ports: opened raw, and found again by what is plugged in, not by name. */
#ifndef TACTUS_PORT_H
#define TACTUS_PORT_H

#include <stdbool.h>
#include <stddef.h>

enum { TACTUS_PORT_NAME = 256 };

/* What a port is known by: the USB adapter's identity, or its name alone where it has none. */
typedef struct {
	char name[TACTUS_PORT_NAME];    /* as the URI has it */
	char serial[128], product[128]; /* "" where there is none */
	int vid, pid;                   /* 0 where it is no USB adapter */
} tactus_port;

/*
 * Opens a port (8N1, raw, no flow control) and fills what it is known by; returns the descriptor. TACTUS_ERR_DEVICE,
 * TACTUS_ERR_PERMISSION (with the group to join), TACTUS_ERR_ARGUMENT for a baud rate that it does not do. A terminal
 * that is no serial port (a pty) is opened as it is.
 */
int tactus_port_open(const char *name, int baud, tactus_port *port);
/* The same adapter again, under whatever name it has now. TACTUS_ERR_LOST if it is not there. */
int tactus_port_reopen(tactus_port *port, int baud);
/* "usb-1a86:7523-SERIAL", or the name: what a recording says. */
void tactus_port_identity(const tactus_port *port, char *text, size_t size);
/* Calls found for every serial port that is there. False if found returned false. */
bool tactus_port_list(bool (*found)(void *context, const char *name, const char *description), void *context);

#endif
