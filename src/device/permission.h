/* Device nodes that may not be opened: the message says which rules give access and how to load them. */
#ifndef TACTUS_PERMISSION_H
#define TACTUS_PERMISSION_H

/* TACTUS_ERR_PERMISSION with the whole remedy, in one line. node: "/dev/hidraw0". */
int tactus_fail_permission(const char *node);
/* The remedy alone: the file of rules that belongs to this library, and the command. text of at least 512 bytes. */
const char *tactus_permission_remedy(char *text);
enum { TACTUS_PERMISSION_SIZE = 512 };

#endif
