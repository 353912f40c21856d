/* Files and pipes for the tests of reading and writing. */
#ifndef CORE_FILES_H
#define CORE_FILES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <tactus/error.h>
#include <tactus/table.h>

static char core_folder[] = "core-test-XXXXXX";
static char core_home[4096];

/* Tests run in a fresh folder, so that messages name short files. */
static inline int core_enter(void **state)
{
	(void)state;
	const char *base = getenv("TMPDIR");
	if (!getcwd(core_home, sizeof core_home) || chdir(base ? base : "/tmp") != 0 || !mkdtemp(core_folder))
		return -1;
	return chdir(core_folder);
}

static inline int core_leave(void **state)
{
	(void)state;
	char command[64];
	snprintf(command, sizeof command, "rm -rf %s", core_folder);
	return chdir("..") != 0 || system(command) != 0 || chdir(core_home) != 0;
}

static inline void core_write(const char *path, const char *bytes, size_t length)
{
	FILE *file = fopen(path, "wb");
	assert_non_null(file);
	assert_int_equal(fwrite(bytes, 1, length, file), length);
	assert_int_equal(fclose(file), 0);
}

static inline void core_write_text(const char *path, const char *text)
{
	core_write(path, text, strlen(text));
}

/* The file's bytes, terminated; freed by the caller. */
static inline char *core_read(const char *path)
{
	FILE *file = fopen(path, "rb");
	assert_non_null(file);
	char *text = calloc(1, 1 << 20);
	assert_non_null(text);
	size_t length = fread(text, 1, (1 << 20) - 1, file);
	text[length] = '\0';
	fclose(file);
	return text;
}

static inline void core_expect_file(const char *path, const char *expected)
{
	char *text = core_read(path);
	assert_string_equal(text, expected);
	free(text);
}

/* Everything that a reader delivers, written again in a format. */
static inline int core_copy(const char *from, const tactus_read_options *options, const char *to,
							enum tactus_format format)
{
	tactus_reader *reader;
	tactus_writer *writer;
	tactus_table *block;
	int error = tactus_reader_open(from, options, &reader);
	if (error)
		return error;
	assert_int_equal(tactus_writer_open(to, format, TACTUS_WRITE_OVERWRITE, &writer), 0);
	long rows = tactus_writer_header(writer, tactus_reader_block(reader));
	while (rows >= 0 && (rows = tactus_reader_next(reader, 0, &block)) > 0)
		rows = tactus_writer_rows(writer, block);
	tactus_reader_close(reader);
	if (rows == 0)
		return tactus_writer_close(writer);
	tactus_writer_abort(writer);
	return (int)rows;
}

static inline void core_expect_text(tactus_text text, const char *expected)
{
	assert_int_equal(text.length, strlen(expected));
	assert_memory_equal(text.text, expected, text.length);
}

#endif
