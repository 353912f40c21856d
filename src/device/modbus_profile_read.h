/* Between the files that read a profile: values, and what is made of them. */
#ifndef TACTUS_MODBUS_PROFILE_READ_H
#define TACTUS_MODBUS_PROFILE_READ_H

#include <tactus/readout.h>

#include "device/bench_read.h"
#include "device/modbus_profile.h"

/* The file being read, and what holds for all values of it. */
typedef struct {
	tactus_profile *profile;
	tactus_detectors detectors;
	enum tactus_value_order order;
	long long first_address; /* 1 where the manual counts from 1 */
} tactus_profile_reader;

/* 1 if the key was there, 0 if not, or TACTUS_ERR_INPUT: one of the words (ends with NULL) by its index; a number. */
int tactus_profile_choice(const tactus_toml_node *table, const char *key, const char *const *words, int *index);
int tactus_profile_integer(const tactus_toml_node *table, const char *key, long long least, long long most, int *value);
int tactus_profile_keys(const tactus_toml_node *table, const tactus_bench_key *keys, size_t n, void *object);

/* A text, allocated, in place of the one before; [metadata]: any keys, numbers or texts, for the recording. */
int tactus_profile_text(const tactus_toml_node *table, const char *key, char **text);
int tactus_profile_metadata(const tactus_toml_node *root, tactus_metadata *metadata);

/* A value: address, table, type, order, bit, scale, offset. */
int tactus_profile_value(const tactus_profile_reader *reader, const tactus_toml_node *node, tactus_value *value);
/* [[register]], [[identity]], and [[start]] or [[stop]] by its key: each replaces what the base had. */
int tactus_profile_registers(const tactus_profile_reader *reader, const tactus_toml_node *root);
int tactus_profile_facts(const tactus_profile_reader *reader, const tactus_toml_node *root);
int tactus_profile_writes(const tactus_profile_reader *reader, const tactus_toml_node *root, const char *key,
						  tactus_profile_write *writes, size_t *count);

#endif
