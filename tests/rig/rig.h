/* How the tests of the rig talk to the virtual devices: one line of text to a socket, one line back. */
#ifndef TACTUS_RIG_H
#define TACTUS_RIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Where the devices listen, in the virtual machine. */
#define RIG_USB "/run/virtual_usb"
#define RIG_HID "/run/virtual_hid"

/* A listening socket at `path`; ends the program on failure, as everything here that cannot fail in a test does. */
int rig_listen(const char *path);
/*
 * Serves one connection waiting at `listener`: reads its line, lets `obey` write the answer (a line without its end;
 * empty means done), sends it.
 */
typedef void rig_obey(void *context, char *command, char *answer, size_t size);
void rig_serve(int listener, rig_obey *obey, void *context);

/* Sends `command`, printf-like, to the device at `path`; its answer lasts until the next call. */
const char *rig_tell(const char *path, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The number after "name=" in an answer; ends the program if there is none. */
double rig_value(const char *answer, const char *name);
/* `virtual_x tell WORDS…` on the command line: tells the running device, prints its answer, returns the exit status. */
int rig_tell_words(const char *path, char *const *words, int n);

/* Ends the program with a message and the reason in errno. */
void rig_die(const char *what) __attribute__((noreturn));

int64_t rig_now_ns(void);

/* Little-endian fields of reports, as both buses have them. */
void rig_put16(uint8_t *at, unsigned value);
void rig_put32(uint8_t *at, uint32_t value);
void rig_put64(uint8_t *at, uint64_t value);
unsigned rig_get16(const uint8_t *at);
int rig_get16s(const uint8_t *at);
uint32_t rig_get32(const uint8_t *at);
uint64_t rig_get64(const uint8_t *at);

#endif
