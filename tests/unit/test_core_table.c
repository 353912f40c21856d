/* Tables and metadata as the header describes them. */
#include <math.h>

#include "core_files.h"

static void metadata_keeps_order_and_replaces(void **state)
{
	(void)state;
	tactus_metadata *metadata = tactus_metadata_new();
	double value = -7;
	assert_int_equal(tactus_metadata_set(metadata, "device", "sim"), 0);
	assert_int_equal(tactus_metadata_set_number(metadata, "rate_Hz", 0.1), 0);
	assert_int_equal(tactus_metadata_set(metadata, "seed", "word"), 0);
	assert_int_equal(tactus_metadata_set(metadata, "device", "usb"), 0);
	assert_int_equal(tactus_metadata_count(metadata), 3);
	assert_string_equal(tactus_metadata_key(metadata, 0), "device");
	assert_string_equal(tactus_metadata_value(metadata, 0), "usb");
	assert_string_equal(tactus_metadata_get(metadata, "rate_Hz"), "0.1");
	assert_int_equal(tactus_metadata_get_number(metadata, "rate_Hz", &value), 1);
	assert_true(value == 0.1);
	assert_int_equal(tactus_metadata_get_number(metadata, "nothing", &value), 0);
	assert_int_equal(tactus_metadata_get_number(metadata, "seed", &value), TACTUS_ERR_INPUT);
	assert_true(value == 0.1);
	assert_int_equal(tactus_metadata_set(metadata, "device", NULL), 0);
	assert_int_equal(tactus_metadata_set_number(metadata, "rate_Hz", NAN), 0);
	assert_int_equal(tactus_metadata_count(metadata), 1);
	assert_null(tactus_metadata_get(metadata, "device"));
	assert_null(tactus_metadata_key(metadata, 1));
	tactus_metadata_free(metadata);
}

static void new_rows_are_missing_in_every_column(void **state)
{
	(void)state;
	tactus_table *table = tactus_table_new();
	assert_int_equal(tactus_table_resize(table, 2), 0);
	double *force = tactus_table_set_numbers(table, "force_N");
	assert_true(isnan(force[0]) && isnan(force[1]));
	force[0] = 1;
	force[1] = 2;
	tactus_text *quality = tactus_table_set_texts(table, "quality");
	assert_int_equal(quality[1].length, 0);
	quality[0] = (tactus_text){"ok", 2};
	assert_int_equal(tactus_table_resize(table, 5000), 0);
	const double *numbers = tactus_table_numbers(table, "force_N");
	assert_true(numbers[1] == 2 && isnan(numbers[2]) && isnan(numbers[4999]));
	const tactus_text *texts = tactus_table_texts(table, "quality");
	core_expect_text(texts[0], "ok");
	assert_int_equal(texts[4999].length, 0);
	assert_int_equal(tactus_table_line(table, 3), 0);
	assert_string_equal(tactus_table_file(table), "");
	tactus_table_free(table);
}

static void a_column_is_replaced_where_it_stands(void **state)
{
	(void)state;
	tactus_table *table = tactus_table_new();
	assert_int_equal(tactus_table_resize(table, 1), 0);
	tactus_table_set_numbers(table, "a")[0] = 1;
	tactus_table_set_numbers(table, "b")[0] = 2;
	tactus_table_set_texts(table, "a")[0] = (tactus_text){"x", 1};
	assert_int_equal(tactus_table_columns(table), 2);
	assert_int_equal(tactus_table_find(table, "a"), 0);
	assert_int_equal(tactus_table_type(table, 0), TACTUS_COLUMN_TEXT);
	assert_null(tactus_table_numbers(table, "a"));
	core_expect_text(tactus_table_texts(table, "a")[0], "x");
	assert_true(isnan(tactus_table_set_numbers(table, "b")[0]));
	tactus_table_remove(table, "a");
	tactus_table_remove(table, "a");
	assert_int_equal(tactus_table_columns(table), 1);
	assert_int_equal(tactus_table_find(table, "a"), -1);
	assert_string_equal(tactus_table_name(table, 0), "b");
	assert_null(tactus_table_name(table, 1));
	assert_null(tactus_table_numbers(table, "a"));
	tactus_table_free(table);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(metadata_keeps_order_and_replaces),
		cmocka_unit_test(new_rows_are_missing_in_every_column),
		cmocka_unit_test(a_column_is_replaced_where_it_stands),
	};
	return cmocka_run_group_tests_name("core table", tests, NULL, NULL);
}
