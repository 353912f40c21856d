/*
 * TOML files through toml++ behind a C interface: a read-only tree whose nodes know FILE:LINE:COLUMN. Every access
 * marks a key as used, so that what nobody asked for can be reported as an unknown key.
 */
#ifndef TACTUS_TOML_H
#define TACTUS_TOML_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tactus_toml tactus_toml;           /* a document, owns every node */
typedef struct tactus_toml_node tactus_toml_node; /* a table, array or value of it */

/* Parses a file ("-": standard input) or a text (name is printed in errors). TACTUS_ERR_INPUT with FILE:LINE:COLUMN. */
int tactus_toml_read(const char *path, tactus_toml **document);
int tactus_toml_parse(const char *name, const char *text, tactus_toml **document);
void tactus_toml_free(tactus_toml *document);
const tactus_toml_node *tactus_toml_root(const tactus_toml *document);

/* Sub-tables and arrays of tables: 1 and *child if there, 0 if not, TACTUS_ERR_INPUT if the key has another type. */
int tactus_toml_table(const tactus_toml_node *node, const char *key, const tactus_toml_node **child);
int tactus_toml_array(const tactus_toml_node *node, const char *key, const tactus_toml_node **child);
size_t tactus_toml_size(const tactus_toml_node *node);                           /* of a table or array */
const tactus_toml_node *tactus_toml_at(const tactus_toml_node *array, size_t i); /* i-th item */
const char *tactus_toml_key(const tactus_toml_node *table, size_t i);            /* i-th key, in file order */
/* True if the key is there and is of that kind: 't' table, 'a' array, 'n' number, 's' string, 'b' boolean. */
bool tactus_toml_is(const tactus_toml_node *table, const char *key, char kind);
/* Values of a table: 1 if there, 0 if not (*value untouched), TACTUS_ERR_INPUT on a wrong type. Strings owned by it. */
int tactus_toml_number(const tactus_toml_node *table, const char *key, double *value);
int tactus_toml_integer(const tactus_toml_node *table, const char *key, long long *value);
int tactus_toml_bool(const tactus_toml_node *table, const char *key, bool *value);
int tactus_toml_string(const tactus_toml_node *table, const char *key, const char **value);
/* Values of an array item. */
int tactus_toml_item_number(const tactus_toml_node *array, size_t i, double *value);
int tactus_toml_item_string(const tactus_toml_node *array, size_t i, const char **value);
/* Fails (returns code) with "FILE:LINE:COLUMN: " and the message, at the node or at one of its keys (NULL: the node).
 */
int tactus_toml_fail(const tactus_toml_node *node, const char *key, int code, const char *format, ...)
	__attribute__((format(printf, 4, 5)));
#ifdef __clang_analyzer__ /* which cannot see into another file that it returns its code */
#define tactus_toml_fail(node, key, code, ...) ((void)(tactus_toml_fail)(node, key, code, __VA_ARGS__), (code))
#endif
/* TACTUS_ERR_INPUT with FILE:LINE:COLUMN at the first key in the whole document that no call asked for. */
int tactus_toml_check_unknown(const tactus_toml *document);

#ifdef __cplusplus
}
#endif

#endif
