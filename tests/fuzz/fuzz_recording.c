/* Any bytes as a recording: read block by block, read whole, and diagnosed if it is small. */
#include "fuzz.h"

enum { ROWS_MAX = 200, COLUMNS_MAX = 50 };

static void read_blocks(const char *path)
{
	tactus_reader *reader;
	tactus_table *block;
	if (tactus_reader_open(path, NULL, &reader) < 0)
		return;
	while (tactus_reader_next(reader, 7, &block) > 0)
		FUZZ_HOLDS(tactus_table_rows(block) <= 7);
	tactus_reader_close(reader);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	char path[FUZZ_PATH_SIZE];
	int fd = fuzz_file(data, size, path);
	tactus_table *table;
	read_blocks(path);
	if (tactus_table_read(path, NULL, &table) == 0) {
		if (tactus_table_rows(table) <= ROWS_MAX && tactus_table_columns(table) <= COLUMNS_MAX)
			fuzz_diagnose((const tactus_table *const[]){table}, 1, NULL);
		tactus_table_free(table);
	}
	close(fd);
	return 0;
}
