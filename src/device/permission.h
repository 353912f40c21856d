/* Device nodes that may not be opened: the message says what gives access. */
#ifndef TACTUS_PERMISSION_H
#define TACTUS_PERMISSION_H

/* TACTUS_ERR_PERMISSION with the whole remedy, in one line. node: "/dev/hidraw0". */
int tactus_fail_permission(const char *node);
/* The remedy alone: the file of rules that belongs to this library, and the command. text of at least 512 bytes. */
const char *tactus_permission_remedy(char *text);
/* The same of a serial port, "/dev/ttyUSB0": the group that it belongs to. */
int tactus_fail_port_permission(const char *node);
const char *tactus_permission_port_remedy(const char *node, char *text);
enum { TACTUS_PERMISSION_SIZE = 512 };

#endif
