/* What readers do with metadata beside the public calls. */
#ifndef TACTUS_METADATA_H
#define TACTUS_METADATA_H

#include <tactus/table.h>

/*
 * Adds a pair at the end, even if the key is there already: a file's lines are kept as they are. line: of the file that
 * says it, 0 if none does.
 */
int tactus_metadata_append(tactus_metadata *metadata, const char *key, size_t key_length, const char *value,
						   size_t value_length, size_t line);
/* The file's name as it is printed in errors. */
int tactus_metadata_set_file(tactus_metadata *metadata, const char *file);
/* TACTUS_ERR_INPUT about the value of a key: the message begins with the file and the line that says it, if any. */
int tactus_metadata_fail(const tactus_metadata *metadata, const char *key, const char *format, ...) TACTUS_PRINTF(3, 4);

#endif
