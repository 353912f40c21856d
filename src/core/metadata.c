/* Metadata: an ordered list of `key: value` pairs. A comment line is a pair whose key is "". */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/metadata.h"

struct pair {
	char *key, *value;
	size_t line; /* of the file, 0: it was set */
};

struct tactus_metadata {
	struct pair *pairs;
	size_t count, capacity;
	char *file; /* NULL: none */
};

tactus_metadata *tactus_metadata_new(void)
{
	return calloc(1, sizeof(tactus_metadata));
}

void tactus_metadata_free(tactus_metadata *metadata)
{
	if (!metadata)
		return;
	for (size_t i = 0; i < metadata->count; i++) {
		free(metadata->pairs[i].key);
		free(metadata->pairs[i].value);
	}
	free(metadata->pairs);
	free(metadata->file);
	free(metadata);
}

int tactus_metadata_set_file(tactus_metadata *metadata, const char *file)
{
	free(metadata->file);
	metadata->file = tactus_strndup(file, strlen(file));
	return metadata->file ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

/* The index of the first pair with that key at or after `from`, or count. */
static size_t find(const tactus_metadata *metadata, const char *key, size_t from)
{
	while (from < metadata->count && strcmp(metadata->pairs[from].key, key) != 0)
		from++;
	return from;
}

static void remove_at(tactus_metadata *metadata, size_t i)
{
	free(metadata->pairs[i].key);
	free(metadata->pairs[i].value);
	metadata->count--;
	memmove(&metadata->pairs[i], &metadata->pairs[i + 1], (metadata->count - i) * sizeof *metadata->pairs);
}

int tactus_metadata_append(tactus_metadata *metadata, const char *key, size_t key_length, const char *value,
						   size_t value_length, size_t line)
{
	if (metadata->count == metadata->capacity) {
		size_t capacity = metadata->capacity ? 2 * metadata->capacity : 16;
		struct pair *pairs = realloc(metadata->pairs, capacity * sizeof *pairs);
		if (!pairs)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
		metadata->pairs = pairs;
		metadata->capacity = capacity;
	}
	struct pair pair = {tactus_strndup(key, key_length), tactus_strndup(value, value_length), line};
	if (!pair.key || !pair.value) {
		free(pair.key);
		free(pair.value);
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	}
	metadata->pairs[metadata->count++] = pair;
	return TACTUS_OK;
}

int tactus_metadata_set(tactus_metadata *metadata, const char *key, const char *value)
{
	size_t i = find(metadata, key, 0);
	if (value && i == metadata->count)
		return tactus_metadata_append(metadata, key, strlen(key), value, strlen(value), 0);
	if (value) {
		char *copy = tactus_strndup(value, strlen(value));
		if (!copy)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
		free(metadata->pairs[i].value);
		metadata->pairs[i].line = 0;
		metadata->pairs[i++].value = copy;
	}
	/* a file may have said the key twice */
	while ((i = find(metadata, key, i)) < metadata->count)
		remove_at(metadata, i);
	return TACTUS_OK;
}

int tactus_metadata_set_number(tactus_metadata *metadata, const char *key, double value)
{
	char text[TACTUS_NUMBER_SIZE];
	return tactus_metadata_set(metadata, key, tactus_format_number(value, text) > 0 ? text : NULL);
}

const char *tactus_metadata_get(const tactus_metadata *metadata, const char *key)
{
	size_t i = find(metadata, key, 0);
	return i < metadata->count ? metadata->pairs[i].value : NULL;
}

int tactus_metadata_fail(const tactus_metadata *metadata, const char *key, const char *format, ...)
{
	char text[512];
	va_list arguments;
	size_t i = find(metadata, key, 0);
	va_start(arguments, format);
	vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	if (!metadata->file || i == metadata->count || !metadata->pairs[i].line)
		return tactus_fail(TACTUS_ERR_INPUT, "%s", text);
	return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: %s", metadata->file, metadata->pairs[i].line, text);
}

int tactus_metadata_get_number(const tactus_metadata *metadata, const char *key, double *value)
{
	const char *text = tactus_metadata_get(metadata, key);
	if (!text)
		return 0;
	if (!tactus_parse_number(text, strlen(text), value))
		return tactus_metadata_fail(metadata, key, "metadata '%s': '%.60s' is not a number", key, text);
	return 1;
}

size_t tactus_metadata_count(const tactus_metadata *metadata)
{
	return metadata->count;
}

const char *tactus_metadata_key(const tactus_metadata *metadata, size_t i)
{
	return i < metadata->count ? metadata->pairs[i].key : NULL;
}

const char *tactus_metadata_value(const tactus_metadata *metadata, size_t i)
{
	return i < metadata->count ? metadata->pairs[i].value : NULL;
}
