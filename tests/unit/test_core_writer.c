/* Writing recordings: what was read comes out as it was, files appear whole or not at all, every write is checked. */
#include <dirent.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <sys/stat.h>

#include "core/core.h"
#include "core_files.h"

static void csv_that_was_read_is_written_as_it_stood(void **state)
{
	(void)state;
	const char *text = "# device: sim\n# a remark\n# note: a\n# note: b\ntime_s,mode,\"a, b\",force_N,rest\n"
					   "0.10,dc,\"x, \"\"y\"\"\",+1.50,007\n1e3,, p ,,\n";
	core_write_text("in.csv", text);
	assert_int_equal(core_copy("in.csv", NULL, "out.csv", TACTUS_FORMAT_CSV), 0);
	core_expect_file("out.csv", text);
}

static void a_foreign_file_becomes_ours(void **state)
{
	(void)state;
	tactus_read_options options = {.decimal_comma = true, .columns = "time_s=ms/1000,force_N=Kraft"};
	core_write_text("in.csv", "\xef\xbb\xbfms;Kraft;Text;\r\n100;2,50;a,b;1,5\r\n200; ;\"c\"\"d\";x\r\n");
	assert_int_equal(core_copy("in.csv", &options, "out.csv", TACTUS_FORMAT_CSV), 0);
	core_expect_file("out.csv", "# columns: time_s=ms/1000,force_N=Kraft\ntime_s,force_N,Text,column4\n"
								"0.1,2.50,\"a,b\",1.5\n0.2,,\"c\"\"d\",x\n");
}

static void csv_and_json_lines_hold_the_same(void **state)
{
	(void)state;
	const char *csv = "# device: \"x\"\n# seed: 42\n# serial: 0042\n# ok: true\n# a\n# b\nforce_N,mode,wire\n"
					  "1.5,a\tc,\n,\"b\"\"\",2\n-0.25,,1e-09\n";
	const char *json = "{\"metadata\": {\"device\": \"\\\"x\\\"\", \"seed\": 42, \"serial\": \"0042\", \"ok\": true, "
					   "\"#\": [\" a\", \" "
					   "b\"]}}\n{\"force_N\":1.5,\"mode\":\"a\\u0009c\",\"wire\":null}\n{\"force_N\":null,\"mode\":"
					   "\"b\\\"\",\"wire\":2}\n"
					   "{\"force_N\":-0.25,\"mode\":null,\"wire\":1e-09}\n";
	core_write_text("in.csv", csv);
	assert_int_equal(core_copy("in.csv", NULL, "out.jsonl", TACTUS_FORMAT_JSON_LINES), 0);
	core_expect_file("out.jsonl", json);
	assert_int_equal(core_copy("out.jsonl", NULL, "out.csv", TACTUS_FORMAT_CSV), 0);
	core_expect_file("out.csv", csv);
	assert_int_equal(core_copy("out.jsonl", NULL, "again.jsonl", TACTUS_FORMAT_JSON_LINES), 0);
	core_expect_file("again.jsonl", json);
}

static void numbers_of_csv_that_json_does_not_know_are_rewritten(void **state)
{
	(void)state;
	core_write_text("in.csv", "a_N,b_N,c_N,d_N,e_N,f_N\n+1,.5,2.,007,-0,1E+5\n");
	assert_int_equal(core_copy("in.csv", NULL, "out.jsonl", TACTUS_FORMAT_JSON_LINES), 0);
	core_expect_file("out.jsonl", "{\"metadata\": {}}\n"
								  "{\"a_N\":1,\"b_N\":0.5,\"c_N\":2,\"d_N\":7,\"e_N\":-0,\"f_N\":1E+5}\n");
}

static void texts_of_the_caller_are_quoted_where_they_must(void **state)
{
	(void)state;
	const char *const texts[] = {"plain", "a,b", "say \"hi\"", "two\nlines", "# no comment", " blank ", ""};
	size_t rows = TACTUS_COUNT(texts);
	tactus_table *table = tactus_table_new(), *back;
	assert_int_equal(tactus_table_resize(table, rows), 0);
	tactus_text *column = tactus_table_set_texts(table, "quality");
	for (size_t i = 0; i < rows; i++)
		column[i] = (tactus_text){texts[i], strlen(texts[i])};
	tactus_writer *writer;
	assert_int_equal(tactus_writer_open("t.csv", TACTUS_FORMAT_CSV, 0, &writer), 0);
	assert_int_equal(tactus_writer_rows(writer, table), 0);
	assert_int_equal(tactus_writer_close(writer), 0);
	assert_int_equal(tactus_table_read("t.csv", NULL, &back), 0);
	assert_int_equal(tactus_table_rows(back), rows);
	for (size_t i = 0; i < rows; i++)
		core_expect_text(tactus_table_texts(back, "quality")[i], i == 3 ? "two lines" : texts[i]);
	tactus_table_free(back);
	tactus_table_free(table);
}

static void computed_columns_stand_beside_the_lines(void **state)
{
	(void)state;
	tactus_reader *reader;
	tactus_writer *writer;
	tactus_table *block;
	core_write_text("in.csv", "a_N,b_N,c_N,mode\n1.0,2.0,3.0,dc\n4.0,5.0,6.0,ac\n");
	assert_int_equal(tactus_reader_open("in.csv", NULL, &reader), 0);
	assert_int_equal(tactus_writer_open("calc.csv", TACTUS_FORMAT_CSV, 0, &writer), 0);
	while (tactus_reader_next(reader, 1, &block) > 0) {
		double a = tactus_table_numbers(block, "a_N")[0];
		tactus_table_set_numbers(block, "b_N")[0] = a / 8;
		tactus_table_set_numbers(block, "d_N")[0] = NAN;
		tactus_table_set_texts(block, "quality")[0] = (tactus_text){"ok", 2};
		assert_int_equal(tactus_writer_rows(writer, block), 0);
	}
	assert_int_equal(tactus_writer_close(writer), 0);
	tactus_reader_close(reader);
	core_expect_file("calc.csv", "a_N,b_N,c_N,mode,d_N,quality\n1.0,0.125,3.0,dc,,ok\n4.0,0.5,6.0,ac,,ok\n");
}

/* Large tables are formatted by two threads: the rows come out in order, whatever the sizes of the blocks. */
static void tables_of_any_size_are_written_in_order(void **state)
{
	(void)state;
	const size_t sizes[] = {1, 511, 512, 2048, 2049, 10000, 3, 5000};
	tactus_table *table = tactus_table_new(), *back;
	tactus_writer *writer;
	size_t total = 0;
	assert_int_equal(tactus_writer_open("large.csv", TACTUS_FORMAT_CSV, 0, &writer), 0);
	for (size_t s = 0; s < TACTUS_COUNT(sizes); s++) {
		assert_int_equal(tactus_table_resize(table, sizes[s]), 0);
		double *sequence = tactus_table_set_numbers(table, "sequence"),
			   *force = tactus_table_set_numbers(table, "force_N");
		for (size_t r = 0; r < sizes[s]; r++, total++) {
			sequence[r] = (double)total;
			force[r] = (double)total / 3;
		}
		assert_int_equal(tactus_writer_rows(writer, table), 0);
		for (size_t r = 0; r < sizes[s]; r++)
			sequence[r] = -1; /* the table is the caller's again */
		if (s == 3)
			assert_int_equal(tactus_writer_flush(writer), 0);
	}
	assert_int_equal(tactus_writer_close(writer), 0);
	assert_int_equal(tactus_table_read("large.csv", NULL, &back), 0);
	assert_int_equal(tactus_table_rows(back), total);
	const double *sequence = tactus_table_numbers(back, "sequence"), *force = tactus_table_numbers(back, "force_N");
	for (size_t r = 0; r < total; r++)
		assert_true(sequence[r] == (double)r && force[r] == (double)r / 3);
	tactus_table_free(back);
	tactus_table_free(table);
}

static void a_single_column_keeps_its_missing_values(void **state)
{
	(void)state;
	core_write_text("in.csv", "force_N\n1\n\"\"\n2\n");
	tactus_table *table;
	assert_int_equal(core_copy("in.csv", NULL, "out.jsonl", TACTUS_FORMAT_JSON_LINES), 0);
	assert_int_equal(core_copy("out.jsonl", NULL, "out.csv", TACTUS_FORMAT_CSV), 0);
	assert_int_equal(tactus_table_read("out.csv", NULL, &table), 0);
	assert_int_equal(tactus_table_rows(table), 3);
	assert_true(isnan(tactus_table_numbers(table, "force_N")[1]));
	tactus_table_free(table);
}

/* ---- files ---- */

static tactus_table *one_row(double force_N)
{
	tactus_table *table = tactus_table_new();
	assert_int_equal(tactus_table_resize(table, 1), 0);
	tactus_table_set_numbers(table, "force_N")[0] = force_N;
	return table;
}

static tactus_writer *open_with_row(const char *path, enum tactus_format format, unsigned flags, double force_N)
{
	tactus_writer *writer;
	tactus_table *table = one_row(force_N);
	if (tactus_writer_open(path, format, flags, &writer) != 0)
		fail_msg("%s", tactus_error_message());
	assert_int_equal(tactus_writer_rows(writer, table), 0);
	tactus_table_free(table);
	return writer;
}

static size_t count_files(const char *prefix)
{
	size_t count = 0;
	DIR *folder = opendir(".");
	for (struct dirent *entry; (entry = readdir(folder));)
		count += strncmp(entry->d_name, prefix, strlen(prefix)) == 0;
	closedir(folder);
	return count;
}

static void a_file_appears_whole_or_not_at_all(void **state)
{
	(void)state;
	tactus_writer *writer = open_with_row("new.csv", TACTUS_FORMAT_CSV, 0, 1);
	assert_int_equal(tactus_writer_flush(writer), 0);
	assert_int_equal(access("new.csv", F_OK), -1);
	tactus_writer_abort(writer);
	assert_int_equal(count_files("new.csv"), 0);
	writer = open_with_row("new.csv", TACTUS_FORMAT_CSV, 0, 1);
	assert_int_equal(tactus_writer_close(writer), 0);
	core_expect_file("new.csv", "force_N\n1\n");
	assert_int_equal(count_files("new.csv"), 1);
	struct stat info;
	mode_t mask = umask(0);
	umask(mask);
	assert_int_equal(stat("new.csv", &info), 0);
	assert_int_equal(info.st_mode & 0777, 0666 & ~mask);
}

static void an_existing_file_is_replaced_only_if_asked(void **state)
{
	(void)state;
	tactus_writer *writer = NULL;
	core_write_text("old.csv", "precious");
	assert_int_equal(tactus_writer_open("old.csv", TACTUS_FORMAT_CSV, 0, &writer), TACTUS_ERR_ARGUMENT);
	assert_null(writer);
	assert_non_null(strstr(tactus_error_message(), "old.csv"));
	assert_int_equal(tactus_writer_open("old.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_IN_PLACE, &writer),
					 TACTUS_ERR_ARGUMENT);
	writer = open_with_row("old.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_OVERWRITE, 2);
	assert_int_equal(tactus_writer_flush(writer), 0);
	core_expect_file("old.csv", "precious");
	tactus_writer_abort(writer);
	core_expect_file("old.csv", "precious");
	writer = open_with_row("old.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_OVERWRITE, 2);
	assert_int_equal(tactus_writer_close(writer), 0);
	core_expect_file("old.csv", "force_N\n2\n");
	assert_int_equal(count_files("old.csv"), 1);
}

static void a_file_that_came_meanwhile_is_not_replaced(void **state)
{
	(void)state;
	tactus_writer *writer = open_with_row("race.csv", TACTUS_FORMAT_CSV, 0, 1);
	core_write_text("race.csv", "precious");
	assert_int_equal(tactus_writer_close(writer), TACTUS_ERR_OUTPUT);
	core_expect_file("race.csv", "precious");
	assert_int_equal(count_files("race.csv"), 1);
}

static void in_place_keeps_what_was_acquired(void **state)
{
	(void)state;
	core_write_text("scan.csv", "an older and longer recording, of another bench\n");
	tactus_writer *writer;
	assert_int_equal(
		tactus_writer_open("scan.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_IN_PLACE | TACTUS_WRITE_OVERWRITE, &writer), 0);
	tactus_writer_abort(writer); /* the device did not open: the old recording is not lost */
	core_expect_file("scan.csv", "an older and longer recording, of another bench\n");
	writer = open_with_row("scan.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_IN_PLACE | TACTUS_WRITE_OVERWRITE, 3);
	assert_int_equal(tactus_writer_flush(writer), 0);
	core_expect_file("scan.csv", "force_N\n3\n");
	tactus_writer_abort(writer);
	core_expect_file("scan.csv", "force_N\n3\n");
	assert_int_equal(tactus_writer_open("none.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_IN_PLACE, &writer), 0);
	tactus_writer_abort(writer);
	assert_int_equal(count_files("none.csv"), 0);
}

static void a_link_is_written_through(void **state)
{
	(void)state;
	core_write_text("target.csv", "old");
	assert_int_equal(symlink("target.csv", "link.csv"), 0);
	tactus_writer *writer = open_with_row("link.csv", TACTUS_FORMAT_CSV, TACTUS_WRITE_OVERWRITE, 4);
	assert_int_equal(tactus_writer_close(writer), 0);
	core_expect_file("target.csv", "force_N\n4\n");
	struct stat info;
	assert_int_equal(lstat("link.csv", &info), 0);
	assert_true(S_ISLNK(info.st_mode));
}

static void appended_records_have_no_second_header(void **state)
{
	(void)state;
	const struct {
		enum tactus_format format;
		const char *before, *after;
	} cases[] = {
		{TACTUS_FORMAT_CSV, "# seed: 1\nforce_N\n1\n", "# seed: 1\nforce_N\n1\n5\n"},
		{TACTUS_FORMAT_CSV, "force_N\n1", "force_N\n1\n5\n"},
		{TACTUS_FORMAT_CSV, "", "force_N\n5\n"},
		{TACTUS_FORMAT_CSV, NULL, "force_N\n5\n"},
		{TACTUS_FORMAT_JSON_LINES, "{\"metadata\": {}}\n{\"force_N\":1}\n",
		 "{\"metadata\": {}}\n{\"force_N\":1}\n{\"force_N\":5}\n"},
	};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		unlink("append");
		if (cases[i].before)
			core_write_text("append", cases[i].before);
		tactus_writer *writer = open_with_row("append", cases[i].format, TACTUS_WRITE_APPEND, 5);
		assert_int_equal(tactus_writer_close(writer), 0);
		core_expect_file("append", cases[i].after);
	}
}

static void other_columns_are_not_appended(void **state)
{
	(void)state;
	const struct {
		const char *before;
		int error;
		const char *words;
	} cases[] = {{"time_s,force_N\n0,1\n", TACTUS_ERR_ARGUMENT, "'time_s'"},
				 {"force_N,mode\n1,ac\n", TACTUS_ERR_ARGUMENT, "'mode'"},
				 {"{\"force_N\":1}\n", TACTUS_ERR_ARGUMENT, "jsonl"},
				 {"force_N,force_N\n1,2\n", TACTUS_ERR_INPUT, "append:1: "}};
	tactus_table *table = one_row(1);
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		tactus_writer *writer;
		core_write_text("append", cases[i].before);
		assert_int_equal(tactus_writer_open("append", TACTUS_FORMAT_CSV, TACTUS_WRITE_APPEND, &writer), 0);
		assert_int_equal(tactus_writer_rows(writer, table), cases[i].error);
		assert_non_null(strstr(tactus_error_message(), cases[i].words));
		tactus_writer_abort(writer);
		core_expect_file("append", cases[i].before);
	}
	tactus_table_free(table);
}

static void rows_with_other_columns_than_the_header_are_refused(void **state)
{
	(void)state;
	tactus_table *table = one_row(1);
	tactus_writer *writer = open_with_row("other.csv", TACTUS_FORMAT_CSV, 0, 1);
	tactus_table_set_numbers(table, "time_s");
	assert_int_equal(tactus_writer_rows(writer, table), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "'time_s'"));
	tactus_writer_abort(writer);
	tactus_table_free(table);
}

/* ---- failures ---- */

static void a_full_disk_is_an_output_error(void **state)
{
	(void)state;
	tactus_writer *writer = open_with_row("/dev/full", TACTUS_FORMAT_CSV, 0, 1);
	assert_int_equal(tactus_writer_flush(writer), TACTUS_ERR_OUTPUT);
	assert_memory_equal(tactus_error_message(), "/dev/full: ", 11);
	tactus_writer_abort(writer);
	writer = open_with_row("/dev/full", TACTUS_FORMAT_CSV, 0, 1);
	assert_int_equal(tactus_writer_close(writer), TACTUS_ERR_OUTPUT);
	assert_int_equal(tactus_writer_open("no/such/folder/x.csv", TACTUS_FORMAT_CSV, 0, &writer), TACTUS_ERR_OUTPUT);
	assert_int_equal(tactus_writer_open("/", TACTUS_FORMAT_CSV, 0, &writer), TACTUS_ERR_OUTPUT);
}

static void a_large_table_on_a_full_disk_fails_while_rows_are_written(void **state)
{
	(void)state;
	tactus_writer *writer;
	tactus_table *table = one_row(0.1);
	assert_int_equal(tactus_table_resize(table, 1000000), 0);
	assert_int_equal(tactus_writer_open("/dev/full", TACTUS_FORMAT_CSV, 0, &writer), 0);
	assert_int_equal(tactus_writer_rows(writer, table), TACTUS_ERR_OUTPUT);
	tactus_writer_abort(writer);
	tactus_table_free(table);
}

static void a_closed_pipe_is_told_from_a_failure(void **state)
{
	(void)state;
	int ends[2];
	char path[32];
	signal(SIGPIPE, SIG_IGN);
	assert_int_equal(pipe(ends), 0);
	snprintf(path, sizeof path, "/dev/fd/%d", ends[1]);
	tactus_writer *writer = open_with_row(path, TACTUS_FORMAT_CSV, 0, 1);
	char text[32];
	assert_int_equal(tactus_writer_flush(writer), 0);
	assert_int_equal(read(ends[0], text, sizeof text), strlen("force_N\n1\n"));
	close(ends[0]);
	tactus_table *table = one_row(2);
	assert_int_equal(tactus_writer_rows(writer, table), 0);
	assert_int_equal(tactus_writer_flush(writer), TACTUS_ERR_CLOSED);
	tactus_writer_abort(writer);
	tactus_table_free(table);
	close(ends[1]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(csv_that_was_read_is_written_as_it_stood),
		cmocka_unit_test(a_foreign_file_becomes_ours),
		cmocka_unit_test(csv_and_json_lines_hold_the_same),
		cmocka_unit_test(numbers_of_csv_that_json_does_not_know_are_rewritten),
		cmocka_unit_test(texts_of_the_caller_are_quoted_where_they_must),
		cmocka_unit_test(computed_columns_stand_beside_the_lines),
		cmocka_unit_test(tables_of_any_size_are_written_in_order),
		cmocka_unit_test(a_single_column_keeps_its_missing_values),
		cmocka_unit_test(a_file_appears_whole_or_not_at_all),
		cmocka_unit_test(an_existing_file_is_replaced_only_if_asked),
		cmocka_unit_test(a_file_that_came_meanwhile_is_not_replaced),
		cmocka_unit_test(in_place_keeps_what_was_acquired),
		cmocka_unit_test(a_link_is_written_through),
		cmocka_unit_test(appended_records_have_no_second_header),
		cmocka_unit_test(other_columns_are_not_appended),
		cmocka_unit_test(rows_with_other_columns_than_the_header_are_refused),
		cmocka_unit_test(a_full_disk_is_an_output_error),
		cmocka_unit_test(a_large_table_on_a_full_disk_fails_while_rows_are_written),
		cmocka_unit_test(a_closed_pipe_is_told_from_a_failure),
	};
	return cmocka_run_group_tests_name("core writer", tests, core_enter, core_leave);
}
