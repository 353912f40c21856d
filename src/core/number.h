/* Numbers inside longer text. */
#ifndef TACTUS_NUMBER_H
#define TACTUS_NUMBER_H

#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The length of the finite number that text begins with, and its value; 0 if it begins with none. */
size_t tactus_number_prefix(const char *text, size_t length, double *value);

#ifdef __cplusplus
}
#endif

#endif
