/* What readers do with metadata beside the public calls. */
#ifndef TACTUS_METADATA_H
#define TACTUS_METADATA_H

#include <tactus/table.h>

/* Adds a pair at the end, even if the key is there already: a file's lines are kept as they are. */
int tactus_metadata_append(tactus_metadata *metadata, const char *key, size_t key_length, const char *value,
						   size_t value_length);

#endif
