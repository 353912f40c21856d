/* Text that lives as long as a block or a table: chunks that are handed out bytewise and freed together. */
#include <stdlib.h>
#include <string.h>

#include "core/arena.h"

enum { CHUNK_SIZE = 64 << 10 };

struct chunk {
	struct chunk *next;
	size_t used, size;
	char bytes[];
};

struct tactus_arena {
	struct chunk *chunks;
};

struct tactus_arena *tactus_arena_new(void)
{
	return calloc(1, sizeof(struct tactus_arena));
}

char *tactus_arena_copy(struct tactus_arena *arena, const char *text, size_t length)
{
	struct chunk *chunk = arena->chunks;
	if (!chunk || chunk->size - chunk->used < length) {
		size_t size = length > CHUNK_SIZE ? length : CHUNK_SIZE;
		chunk = malloc(sizeof *chunk + size);
		if (!chunk)
			return NULL;
		*chunk = (struct chunk){.next = arena->chunks, .size = size};
		arena->chunks = chunk;
	}
	char *copy = chunk->bytes + chunk->used;
	memcpy(copy, text, length);
	chunk->used += length;
	return copy;
}

void tactus_arena_clear(struct tactus_arena *arena)
{
	while (arena->chunks && arena->chunks->next) {
		struct chunk *next = arena->chunks->next;
		free(arena->chunks);
		arena->chunks = next;
	}
	if (arena->chunks)
		arena->chunks->used = 0;
}

void tactus_arena_free(struct tactus_arena *arena)
{
	if (!arena)
		return;
	tactus_arena_clear(arena);
	free(arena->chunks);
	free(arena);
}
