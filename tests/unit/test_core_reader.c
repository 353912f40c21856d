/* Reading recordings: what is accepted, and every kind of bad input with the line that is wrong. */
#include <math.h>
#include <sys/stat.h>

#include "core/core.h"
#include "core_files.h"

static tactus_table *read_text(const char *text, const tactus_read_options *options)
{
	tactus_table *table = NULL;
	core_write_text("in.csv", text);
	if (tactus_table_read("in.csv", options, &table) != 0)
		fail_msg("%s", tactus_error_message());
	return table;
}

static void expect_numbers(const tactus_table *table, const char *name, size_t rows, const double *expected)
{
	const double *numbers = tactus_table_numbers(table, name);
	assert_non_null(numbers);
	assert_int_equal(tactus_table_rows(table), rows);
	for (size_t i = 0; i < rows; i++)
		assert_true(isnan(expected[i]) ? isnan(numbers[i]) : numbers[i] == expected[i]);
}

static void a_recording_is_read_with_metadata_lines_and_types(void **state)
{
	(void)state;
	tactus_table *table = read_text("# device: sim: eight sensors\n# a remark\n#seed: 3\n"
									"time_s,mode,force_N,note,humidity\n"
									"0,dc,1.5,,\n# a comment later\n\n0.5,ac,,7x,40\n",
									NULL);
	expect_numbers(table, "time_s", 2, (double[]){0, 0.5});
	expect_numbers(table, "force_N", 2, (double[]){1.5, NAN});
	expect_numbers(table, "humidity", 2, (double[]){NAN, 40});
	core_expect_text(tactus_table_texts(table, "mode")[1], "ac");
	core_expect_text(tactus_table_texts(table, "note")[0], "");
	core_expect_text(tactus_table_texts(table, "note")[1], "7x");
	assert_int_equal(tactus_table_line(table, 0), 5);
	assert_int_equal(tactus_table_line(table, 1), 8);
	assert_string_equal(tactus_table_file(table), "in.csv");
	const tactus_metadata *metadata = tactus_table_metadata(table);
	assert_string_equal(tactus_metadata_get(metadata, "device"), "sim: eight sensors");
	assert_string_equal(tactus_metadata_get(metadata, "seed"), "3");
	assert_string_equal(tactus_metadata_key(metadata, 1), "");
	assert_string_equal(tactus_metadata_value(metadata, 1), " a remark");
	tactus_table_free(table);
}

static void line_ends_marks_quotes_and_blanks_do_not_matter(void **state)
{
	(void)state;
	tactus_table *table = read_text("\xef\xbb\xbf# key: v\r\n\"force_N\" , \"a \"\"b\"\", c\"\r\n"
									" +1.5 ,\"x, \"\"y\"\"\"\r\n\"2\",\"\"\r\n3,z",
									NULL);
	expect_numbers(table, "force_N", 3, (double[]){1.5, 2, 3});
	const tactus_text *texts = tactus_table_texts(table, "a \"b\", c");
	core_expect_text(texts[0], "x, \"y\"");
	core_expect_text(texts[1], "");
	core_expect_text(texts[2], "z");
	assert_int_equal(tactus_table_line(table, 0), 3);
	assert_int_equal(tactus_table_line(table, 1), 4);
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "key"), "v");
	tactus_table_free(table);
}

static void a_guessed_column_becomes_text_at_its_first_word(void **state)
{
	(void)state;
	char *text = calloc(1, 100000), *p = text;
	p += sprintf(p, "force_N,wire\n");
	for (int i = 0; i < 5000; i++) /* more than a block, so that numbers were delivered before */
		p += sprintf(p, "%d,%g\n", i, i / 2.0);
	sprintf(p, "5000,red\n");
	tactus_table *table = read_text(text, NULL);
	const tactus_text *wire = tactus_table_texts(table, "wire");
	assert_non_null(wire);
	core_expect_text(wire[1], "0.5");
	core_expect_text(wire[5000], "red");
	tactus_table_free(table);
	free(text);
}

static void a_column_without_values_is_missing_numbers(void **state)
{
	(void)state;
	tactus_table *table = read_text("force_N,empty\n1,\n2,\n", NULL);
	expect_numbers(table, "empty", 2, (double[]){NAN, NAN});
	tactus_table_free(table);
}

static void separators_are_told_by_the_header(void **state)
{
	(void)state;
	const struct {
		const char *text;
		tactus_read_options options;
	} cases[] = {
		{"force_N;mode\n1.5;a\n", {0}},
		{"force_N\tmode\n1.5\ta\n", {0}},
		{"force_N;mode\n1,5;a\n", {.decimal_comma = true}},
		{"force_N\tmode\n1,5\ta\n", {.decimal_comma = true}},
		{"force_N|mode\n1.5|a\n", {.delimiter = '|'}},
		{"force_N,mode\n\"1,5\",a\n", {.delimiter = ',', .decimal_comma = true}},
	};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		tactus_table *table = read_text(cases[i].text, &cases[i].options);
		expect_numbers(table, "force_N", 1, (double[]){1.5});
		core_expect_text(tactus_table_texts(table, "mode")[0], "a");
		tactus_table_free(table);
	}
}

static void json_lines_are_read_like_csv(void **state)
{
	(void)state;
	tactus_table *table =
		read_text("{\"metadata\": {\"device\": \"sim\", \"seed\": 3, \"#\": [\" remark\"], \"x\": true}}\n"
				  "{\"force_N\": 1.5, \"mode\": \"dc\", \"n\": null}\r\n\n"
				  "{\"mode\": \"a\\u0022c\", \"force_N\": null}\n"
				  "{\"n\": 1e2, \"force_N\": 3}",
				  NULL);
	expect_numbers(table, "force_N", 3, (double[]){1.5, NAN, 3});
	expect_numbers(table, "n", 3, (double[]){NAN, NAN, 100});
	core_expect_text(tactus_table_texts(table, "mode")[1], "a\"c");
	core_expect_text(tactus_table_texts(table, "mode")[2], "");
	assert_int_equal(tactus_table_line(table, 1), 4);
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "seed"), "3");
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "x"), "true");
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), ""), " remark");
	tactus_table_free(table);
}

/* ---- foreign files ---- */

static void columns_are_renamed_and_scaled(void **state)
{
	(void)state;
	tactus_read_options options = {.decimal_comma = true,
								   .columns = "time_s=t [ms]/1000,force_N=load kg*9.81,speed=v m/s,drive_V=u*2/4"};
	tactus_table *table = read_text("t [ms];load kg;v m/s;rest;u\n500;2,5;7;8;3\n;;;;\n", &options);
	expect_numbers(table, "time_s", 2, (double[]){0.5, NAN});
	expect_numbers(table, "force_N", 2, (double[]){2.5 * 9.81, NAN});
	expect_numbers(table, "speed", 2, (double[]){7, NAN});
	expect_numbers(table, "rest", 2, (double[]){8, NAN});
	expect_numbers(table, "drive_V", 2, (double[]){1.5, NAN});
	assert_int_equal(tactus_table_find(table, "force_N"), 1);
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "columns"), options.columns);
	tactus_table_free(table);
}

static void a_wide_file_has_a_row_per_channel(void **state)
{
	(void)state;
	tactus_read_options options = {
		.columns = "time_s=ms/1000,conductance_S@1=A0*1e-6,conductance_S@4=A1*1e-6,capacitance_F@4=C1"};
	const char *text = "ms,A0,A1,C1,who\n100,5,7,2,me\n200,6,8,,you\n";
	tactus_table *table = read_text(text, &options);
	expect_numbers(table, "time_s", 4, (double[]){0.1, 0.1, 0.2, 0.2});
	expect_numbers(table, "channel", 4, (double[]){1, 4, 1, 4});
	expect_numbers(table, "conductance_S", 4, (double[]){5 * 1e-6, 7 * 1e-6, 6 * 1e-6, 8 * 1e-6});
	expect_numbers(table, "capacitance_F", 4, (double[]){NAN, 2, NAN, NAN});
	core_expect_text(tactus_table_texts(table, "who")[2], "you");
	assert_int_equal(tactus_table_line(table, 1), 2);
	tactus_table_free(table);

	/* rows of one line may come in several blocks */
	tactus_reader *reader;
	tactus_table *block;
	core_write_text("in.csv", text);
	assert_int_equal(tactus_reader_open("in.csv", &options, &reader), 0);
	for (int i = 0; i < 4; i++) {
		assert_int_equal(tactus_reader_next(reader, 1, &block), 1);
		assert_true(tactus_table_numbers(block, "channel")[0] == (i % 2 ? 4 : 1));
		assert_true(tactus_table_numbers(block, "time_s")[0] == (i < 2 ? 0.1 : 0.2));
	}
	assert_int_equal(tactus_reader_next(reader, 1, &block), 0);
	tactus_reader_close(reader);
}

static void wrong_mappings_are_refused(void **state)
{
	(void)state;
	const struct {
		const char *columns;
		int error;
		const char *words;
	} cases[] = {
		{"time_s", TACTUS_ERR_ARGUMENT, "new=old"},
		{"=ms", TACTUS_ERR_ARGUMENT, "empty"},
		{"time_s=sec", TACTUS_ERR_INPUT, "in.csv:1: there is no column 'sec' to map; the file has: ms, load"},
		{"time_s=ms/x", TACTUS_ERR_INPUT, "'ms/x'"},
		{"time_s=ms/0", TACTUS_ERR_ARGUMENT, "factor"},
		{"load=ms", TACTUS_ERR_INPUT, "two columns 'load'"},
		{"a=ms,a=load", TACTUS_ERR_ARGUMENT, "'a' is made twice"},
		{"a@x=ms", TACTUS_ERR_ARGUMENT, "number of a channel"},
	};
	core_write_text("in.csv", "ms,load\n1,2\n");
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		tactus_reader *reader = NULL;
		tactus_read_options options = {.columns = cases[i].columns};
		assert_int_equal(tactus_reader_open("in.csv", &options, &reader), cases[i].error);
		assert_null(reader);
		if (!strstr(tactus_error_message(), cases[i].words))
			fail_msg("%s: %s", cases[i].columns, tactus_error_message());
	}
}

/* ---- bad input ---- */

struct bad {
	const char *text, *place, *words;
};

static void expect_error(const char *path, const tactus_read_options *options, const struct bad *bad)
{
	tactus_table *table = NULL;
	assert_int_equal(tactus_table_read(path, options, &table), TACTUS_ERR_INPUT);
	assert_null(table);
	const char *message = tactus_error_message();
	if (strncmp(message, bad->place, strlen(bad->place)) != 0 || !strstr(message, bad->words))
		fail_msg("'%s' instead of %s … %s", message, bad->place, bad->words);
}

static void bad_lines_are_named(void **state)
{
	(void)state;
	const struct bad cases[] = {
		{"", "bad.csv:1: ", "empty"},
		{"# a: b\n\n# c: d\n", "bad.csv:4: ", "no header"},
		{"1,2,3\n4,5,6\n", "bad.csv:1: ", "header"},
		{"0.1,dc,5\n0.2,ac,6\n", "bad.csv:1: ", "header"},
		{"# a: b\nforce_N,x,force_N\n1,2,3\n", "bad.csv:2: ", "'force_N' twice (columns 1 and 3)"},
		{"force_N,x\n1,2\n3,4\n5",
		 "bad.csv:4: ", "1 fields where the header names 2 columns; the last line is cut off"},
		{"force_N,x\n1,2\n3\n5,6\n", "bad.csv:3: ", "1 fields where the header names 2"},
		{"force_N,x\n1,2\n3,4,5\n", "bad.csv:3: ", "3 fields where the header names 2"},
		{"x,force_N\n1,2\nx,force_N\n1,2\n", "bad.csv:3: ", "the header is here again ('force_N')"},
		{"force_N,x\n1,5,2\n", "bad.csv:2: ", "--decimal-comma"},
		{"force_N;x\n1;2\n1,5;2\n", "bad.csv:3: '1,5' in column 'force_N'", "--decimal-comma"},
		{"x,force_N\n1,2\n1,two\n", "bad.csv:3: 'two' is not a number", "'force_N'"},
		{"x,force_N\n1,2 3\n", "bad.csv:2: '2 3'", "'force_N'"},
		{"x,force_N\n1,0x10\n", "bad.csv:2: '0x10'", "'force_N'"},
		{"x,force_N\n1,NaN\n", "bad.csv:2: 'NaN' in column 'force_N'", "empty"},
		{"x,force_N\n1,-inf\n", "bad.csv:2: '-inf' in column 'force_N'", "empty"},
		{"x,force_N\n1,1e400\n", "bad.csv:2: '1e400'", "number"},
		{"force_N\n- \n", "bad.csv:2: '-'", "number"},
		{"sequence,mode\n1.5.2,a\n", "bad.csv:2: '1.5.2'", "number"},
		{"gauge12,mode\nx,a\n", "bad.csv:2: 'x'", "'gauge12'"},
		{"force_N,mode\n1,\"a\n", "bad.csv:2: ", "quote"},
		{"force_N,mode\n1,\"a\"b\n", "bad.csv:2: ", "after the closing quote"},
		{"force_N,mode\n1,a\x01\n", "bad.csv:2: ", "0x01"},
		{"force_N,mode\n1,\xff\n", "bad.csv:2: ", "UTF-8"},
		{"force_N,mode\n1,\xed\xa0\x80\n", "bad.csv:2: ", "UTF-8"},
		{"force_N,m\xc3\n1,a\n", "bad.csv:1: ", "UTF-8"},
		{"# k: \xff\nforce_N\n1\n", "bad.csv:1: ", "UTF-8"},
		{"force_N,mode\r1,a\r", "bad.csv:1: ", "carriage return"},
		{"\x7f"
		 "ELF\x02\x01\x01",
		 "bad.csv:1: ", "0x7f"},
		{"\x1f\x8b\x08", "bad.csv:1: ", "0x1f"},
		{"\xff\xfe"
		 "f",
		 "bad.csv:1: ", "UTF-16"},
		{"{\"a\": 1}\n{\"a\": 2,}\n", "bad.csv:2: ", "JSON"},
		{"{\"a\": 1}\n[1]\n", "bad.csv:2: ", "object"},
		{"{\"a\": 1}\n{\"b\": 1}\n", "bad.csv:2: ", "no 'b'"},
		{"{\"a\": 1}\n{\"a\": true}\n", "bad.csv:2: ", "true or false"},
		{"{\"a\": 1}\n{\"a\": [1]}\n", "bad.csv:2: ", "'a'"},
		{"{\"a_N\": 1}\n{\"a_N\": \"1\"}\n", "bad.csv:2: ", "text where a number belongs (column 'a_N')"},
		{"{\"a_N\": 1}\n{\"a_N\": NaN}\n", "bad.csv:2: ", "JSON"},
		{"{\"a_N\": 1}\n{\"a_N\": 1e999}\n", "bad.csv:2: ", "JSON"},
		{"{\"a\": 1, \"a\": 2}\n", "bad.csv:1: ", "duplicate"},
		{"{\"metadata\": {}}\n", "bad.csv:2: ", "no record"},
		{"{\"metadata\": {\"a\": {}}}\n{\"b\": 1}\n", "bad.csv:1: ", "metadata 'a'"},
		{"{}\n", "bad.csv:1: ", "no columns"},
	};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		core_write_text("bad.csv", cases[i].text);
		expect_error("bad.csv", NULL, &cases[i]);
	}
}

static void bytes_that_are_no_text_are_refused(void **state)
{
	(void)state;
	core_write("bad.csv", "force_N,mode\n1,a\n2,\0b\n", 22);
	expect_error("bad.csv", NULL, &(struct bad){.place = "bad.csv:3: ", .words = "0x00"});
	core_write("bad.csv", "f\0o\0,\0x\0\n\0", 10); /* UTF-16 without a mark */
	expect_error("bad.csv", NULL, &(struct bad){.place = "bad.csv:1: ", .words = "0x00"});
	char noise[4096];
	uint32_t seed = 7;
	for (size_t i = 0; i < sizeof noise; i++)
		noise[i] = (char)((seed = seed * 1664525u + 1013904223u) >> 24);
	core_write("bad.csv", noise, sizeof noise);
	expect_error("bad.csv", NULL, &(struct bad){.place = "bad.csv:1: ", .words = ""});
}

static void a_line_of_ten_million_bytes_is_refused(void **state)
{
	(void)state;
	size_t length = 10000000;
	char *text = malloc(length);
	assert_non_null(text);
	memset(text, '1', length);
	memcpy(text, "force_N\n1\n", 10);
	core_write("bad.csv", text, length);
	free(text);
	expect_error("bad.csv", NULL, &(struct bad){.place = "bad.csv:3: ", .words = "longer than 1048576 bytes"});
}

static void a_long_line_is_read(void **state)
{
	(void)state;
	size_t length = 1000000;
	char *text = malloc(length + 40);
	assert_non_null(text);
	memcpy(text, "force_N,note\n5,", 15);
	memset(text + 15, 'x', length);
	memcpy(text + 15 + length, "\n6,y\n", 6);
	tactus_table *table = read_text(text, NULL);
	expect_numbers(table, "force_N", 2, (double[]){5, 6});
	assert_int_equal(tactus_table_texts(table, "note")[0].length, length);
	tactus_table_free(table);
	free(text);
}

static void a_file_that_cannot_be_read_is_an_input_error(void **state)
{
	(void)state;
	assert_int_equal(mkdir("folder", 0777), 0);
	expect_error("nothing.csv", NULL, &(struct bad){.place = "nothing.csv: ", .words = "no such file"});
	expect_error("folder", NULL, &(struct bad){.place = "folder: ", .words = "directory"});
}

static void a_header_without_rows_streams_but_is_no_recording(void **state)
{
	(void)state;
	tactus_reader *reader;
	tactus_table *block, *table = NULL;
	core_write_text("in.csv", "force_N,mode\n# the end\n");
	assert_int_equal(tactus_reader_open("in.csv", NULL, &reader), 0);
	assert_int_equal(tactus_reader_next(reader, 0, &block), 0);
	assert_int_equal(tactus_reader_next(reader, 0, &block), 0);
	tactus_reader_close(reader);
	assert_int_equal(tactus_table_read("in.csv", NULL, &table), TACTUS_ERR_DATA);
	assert_null(table);
}

static void rows_before_a_bad_line_are_delivered(void **state)
{
	(void)state;
	tactus_reader *reader;
	tactus_table *block;
	core_write_text("in.csv", "force_N,mode\n1,a\n2,b\nx,c\n4,d\n");
	assert_int_equal(tactus_reader_open("in.csv", NULL, &reader), 0);
	assert_int_equal(tactus_reader_next(reader, 0, &block), 2);
	assert_true(tactus_table_numbers(block, "force_N")[1] == 2);
	assert_int_equal(tactus_reader_next(reader, 0, &block), TACTUS_ERR_INPUT);
	assert_int_equal(tactus_reader_next(reader, 0, &block), TACTUS_ERR_INPUT);
	assert_memory_equal(tactus_error_message(), "in.csv:4: ", 10);
	tactus_reader_close(reader);
}

static void blocks_of_any_size_give_the_same_rows(void **state)
{
	(void)state;
	char *text = calloc(1, 1 << 20), *p = text;
	p += sprintf(p, "sequence,mode,force_N\n");
	for (int i = 0; i < 20000; i++)
		p += sprintf(p, "%d,%s,%.*g\n", i, i % 3 ? "ac" : "dc", 1 + i % 17, i / 7.0);
	core_write_text("in.csv", text);
	tactus_table *whole = read_text(text, NULL);
	const size_t sizes[] = {1, 7, 1000, 0};
	for (size_t s = 0; s < TACTUS_COUNT(sizes); s++) {
		tactus_reader *reader;
		tactus_table *block;
		size_t row = 0;
		long rows;
		assert_int_equal(tactus_reader_open("in.csv", NULL, &reader), 0);
		while ((rows = tactus_reader_next(reader, sizes[s], &block)) > 0) {
			assert_true(sizes[s] == 0 || (size_t)rows <= sizes[s]);
			for (size_t r = 0; r < (size_t)rows; r++, row++) {
				assert_true(tactus_table_numbers(block, "sequence")[r] == (double)row);
				assert_true(tactus_table_numbers(block, "force_N")[r] == tactus_table_numbers(whole, "force_N")[row]);
				assert_int_equal(tactus_table_texts(block, "mode")[r].text[0], row % 3 ? 'a' : 'd');
				assert_int_equal(tactus_table_line(block, r), row + 2);
			}
		}
		assert_int_equal(row, 20000);
		tactus_reader_close(reader);
	}
	tactus_table_free(whole);
	free(text);
}

static void what_the_caller_changes_in_a_block_is_back_in_the_next(void **state)
{
	(void)state;
	const char *const files[] = {"force_N,quality,channel,wire\n1,ok,1,red\n2,folded,2,blue\n",
								 "{\"force_N\":1,\"quality\":\"ok\",\"channel\":1,\"wire\":\"red\"}\n"
								 "{\"force_N\":2,\"quality\":\"folded\",\"channel\":2,\"wire\":\"blue\"}\n"};
	for (size_t f = 0; f < TACTUS_COUNT(files); f++) {
		tactus_reader *reader;
		tactus_table *block;
		core_write_text("in.csv", files[f]);
		assert_int_equal(tactus_reader_open("in.csv", NULL, &reader), 0);
		for (int i = 1; i <= 2; i++) {
			assert_int_equal(tactus_reader_next(reader, 1, &block), 1);
			core_expect_text(tactus_table_texts(block, "quality")[0], i == 1 ? "ok" : "folded");
			core_expect_text(tactus_table_texts(block, "wire")[0], i == 1 ? "red" : "blue");
			assert_true(tactus_table_numbers(block, "force_N")[0] == i);
			tactus_table_set_texts(block, "quality")[0] = (tactus_text){"mine", 4};
			assert_true(isnan(tactus_table_set_numbers(block, "wire")[0]));
			assert_true(isnan(tactus_table_set_numbers(block, "force_N")[0]));
			assert_true(isnan(tactus_table_set_numbers(block, "added_V")[0]));
			tactus_table_remove(block, "channel");
			assert_int_equal(tactus_table_columns(block), 4);
		}
		tactus_reader_close(reader);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_recording_is_read_with_metadata_lines_and_types),
		cmocka_unit_test(line_ends_marks_quotes_and_blanks_do_not_matter),
		cmocka_unit_test(a_guessed_column_becomes_text_at_its_first_word),
		cmocka_unit_test(a_column_without_values_is_missing_numbers),
		cmocka_unit_test(separators_are_told_by_the_header),
		cmocka_unit_test(json_lines_are_read_like_csv),
		cmocka_unit_test(columns_are_renamed_and_scaled),
		cmocka_unit_test(a_wide_file_has_a_row_per_channel),
		cmocka_unit_test(wrong_mappings_are_refused),
		cmocka_unit_test(bad_lines_are_named),
		cmocka_unit_test(bytes_that_are_no_text_are_refused),
		cmocka_unit_test(a_line_of_ten_million_bytes_is_refused),
		cmocka_unit_test(a_long_line_is_read),
		cmocka_unit_test(a_file_that_cannot_be_read_is_an_input_error),
		cmocka_unit_test(a_header_without_rows_streams_but_is_no_recording),
		cmocka_unit_test(rows_before_a_bad_line_are_delivered),
		cmocka_unit_test(blocks_of_any_size_give_the_same_rows),
		cmocka_unit_test(what_the_caller_changes_in_a_block_is_back_in_the_next),
	};
	return cmocka_run_group_tests_name("core reader", tests, core_enter, core_leave);
}
