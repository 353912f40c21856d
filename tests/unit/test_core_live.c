/* Live recordings: a row is delivered as soon as its line is complete, and not before. No test here sleeps. */
#include <signal.h>
#include <sys/wait.h>

#include "core/core.h"
#include "core_files.h"

/* A reader on a pipe, opened by its name in /dev/fd; the header must be in the pipe already. */
struct live {
	int to;
	tactus_reader *reader;
};

static void feed(const struct live *live, const char *text)
{
	assert_int_equal(write(live->to, text, strlen(text)), strlen(text));
}

static struct live open_live(const char *first)
{
	int ends[2];
	char path[32];
	assert_int_equal(pipe(ends), 0);
	struct live live = {.to = ends[1]};
	feed(&live, first);
	snprintf(path, sizeof path, "/dev/fd/%d", ends[0]);
	assert_int_equal(tactus_reader_open(path, NULL, &live.reader), 0);
	close(ends[0]);
	return live;
}

static void close_live(struct live *live)
{
	tactus_table *block;
	close(live->to);
	assert_true(tactus_reader_ready(live->reader));
	assert_int_equal(tactus_reader_next(live->reader, 0, &block), 0);
	tactus_reader_close(live->reader);
}

static void one_line_is_delivered_at_once(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("force_N,mode\n");
	assert_false(tactus_reader_ready(live.reader));
	for (int i = 0; i < 3; i++) {
		char line[32];
		snprintf(line, sizeof line, "%d,ac\n", i);
		feed(&live, line);
		assert_true(tactus_reader_ready(live.reader));
		assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
		assert_true(tactus_table_numbers(block, "force_N")[0] == i);
		assert_false(tactus_reader_ready(live.reader));
		assert_true(tactus_table_numbers(block, "force_N")[0] == i); /* the block is still there */
	}
	close_live(&live);
}

static void half_a_line_waits(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("force_N,mode\n1,dc\n2,");
	assert_true(tactus_reader_ready(live.reader));
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	assert_false(tactus_reader_ready(live.reader));
	feed(&live, "a");
	assert_false(tactus_reader_ready(live.reader));
	core_expect_text(tactus_table_texts(block, "mode")[0], "dc");
	feed(&live, "c\n");
	assert_true(tactus_reader_ready(live.reader));
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	core_expect_text(tactus_table_texts(block, "mode")[0], "ac");
	close_live(&live);
}

static void lines_that_wait_together_come_together(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("force_N\n1\n2\n3\n");
	assert_int_equal(tactus_reader_next(live.reader, 2, &block), 2);
	assert_true(tactus_reader_ready(live.reader));
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	assert_false(tactus_reader_ready(live.reader));
	close_live(&live);
}

static void json_lines_are_live_too(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("{\"force_N\": 1}\n");
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	assert_false(tactus_reader_ready(live.reader));
	feed(&live, "{\"force_N\": 2}\n");
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	assert_true(tactus_table_numbers(block, "force_N")[0] == 2);
	close_live(&live);
}

static void the_last_line_needs_no_end(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("force_N\n1");
	assert_false(tactus_reader_ready(live.reader));
	close(live.to);
	assert_true(tactus_reader_ready(live.reader));
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 0);
	tactus_reader_close(live.reader);
}

static void ignore(int number)
{
	(void)number;
}

/* A child keeps sending the signal until it is killed, so that one arrives while the reader waits. */
static void a_signal_ends_the_wait(void **state)
{
	(void)state;
	tactus_table *block;
	struct live live = open_live("force_N\n");
	struct sigaction action = {.sa_handler = ignore, .sa_flags = SA_RESTART}, old;
	sigaction(SIGUSR1, &action, &old);
	pid_t parent = getpid(), child = fork();
	if (child == 0)
		for (;;)
			kill(parent, SIGUSR1);
	assert_true(child > 0);
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), TACTUS_ERR_INTERRUPTED);
	kill(child, SIGKILL);
	waitpid(child, NULL, 0);
	sigaction(SIGUSR1, &old, NULL);
	feed(&live, "1\n");
	assert_int_equal(tactus_reader_next(live.reader, 0, &block), 1);
	close_live(&live);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_line_is_delivered_at_once),
		cmocka_unit_test(half_a_line_waits),
		cmocka_unit_test(lines_that_wait_together_come_together),
		cmocka_unit_test(json_lines_are_live_too),
		cmocka_unit_test(the_last_line_needs_no_end),
		cmocka_unit_test(a_signal_ends_the_wait),
	};
	return cmocka_run_group_tests_name("core live", tests, NULL, NULL);
}
