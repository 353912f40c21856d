/* Text that lives as long as a block or a table. */
#ifndef TACTUS_ARENA_H
#define TACTUS_ARENA_H

#include <stddef.h>

struct tactus_arena;

struct tactus_arena *tactus_arena_new(void);
/* A copy of length bytes, not terminated; NULL when memory runs out. */
char *tactus_arena_copy(struct tactus_arena *arena, const char *text, size_t length);
/* Frees all copies; one chunk is kept for the next ones. */
void tactus_arena_clear(struct tactus_arena *arena);
void tactus_arena_free(struct tactus_arena *arena);

#endif
