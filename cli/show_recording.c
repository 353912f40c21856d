/* tactus show RECORDING: read once, block by block: columns, clock, lost scans, channels, metadata. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "show.h"

enum { WORDS_MAX = 16, WORD_SIZE = 64 };

struct word {
	char text[WORD_SIZE];
	size_t rows;
};

struct column {
	const char *name;
	bool is_text;
	size_t values, missing;
	double minimum, maximum;
	struct word words[WORDS_MAX]; /* of a text column, in the order met */
	size_t word_count;
	bool more_words;
};

struct channel {
	double number;
	size_t rows;
	double last_s;
};

/* Instants at which a scan begins (with `sequence`), or all (without): channels side by side share one. */
struct clock {
	double *time_s;
	size_t n, capacity;
	size_t backward, repeated;
	double last_s, last_sequence, first_sequence, lost;
	size_t sequence_gaps, sequence_backward;
	bool has_time, has_sequence;
};

struct recording {
	tactus_table *block;
	const tactus_domain *domain; /* NULL: its columns do not tell */
	size_t rows;
	struct column *columns;
	size_t column_count;
	struct channel *channels;
	size_t channel_count;
	struct clock clock;
};

/* ---- gathering ---- */

static void add_numbers(struct column *column, const double *values, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		if (isnan(values[i])) {
			column->missing++;
			continue;
		}
		column->minimum = column->values ? fmin(column->minimum, values[i]) : values[i];
		column->maximum = column->values ? fmax(column->maximum, values[i]) : values[i];
		column->values++;
	}
}

static void add_word(struct column *column, tactus_text text)
{
	size_t length = text.length < WORD_SIZE ? text.length : WORD_SIZE - 1;
	for (size_t w = 0; w < column->word_count; w++)
		if (strlen(column->words[w].text) == length && !memcmp(column->words[w].text, text.text, length)) {
			column->words[w].rows++;
			return;
		}
	column->more_words = column->word_count == WORDS_MAX;
	if (column->more_words)
		return;
	struct word *word = &column->words[column->word_count++];
	memcpy(word->text, text.text, length);
	word->text[length] = '\0';
	word->rows = 1;
}

static void add_texts(struct column *column, const tactus_text *values, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		if (!values[i].length) {
			column->missing++;
			continue;
		}
		column->values++;
		add_word(column, values[i]);
	}
}

static int add_channels(struct recording *recording, const double *channel, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		size_t c = 0;
		while (c < recording->channel_count && recording->channels[c].number != channel[i])
			c++;
		if (isnan(channel[i]))
			continue;
		if (c == recording->channel_count) {
			struct channel *more = realloc(recording->channels, (c + 1) * sizeof *more);
			if (!more)
				return TACTUS_ERR_MEMORY;
			recording->channels = more;
			more[recording->channel_count++] = (struct channel){.number = channel[i], .last_s = NAN};
		}
		recording->channels[c].rows++;
	}
	return 0;
}

static int add_instant(struct clock *clock, double time_s)
{
	if (clock->n == clock->capacity) {
		size_t capacity = clock->capacity ? 2 * clock->capacity : 1024;
		double *more = realloc(clock->time_s, capacity * sizeof *more);
		if (!more)
			return TACTUS_ERR_MEMORY;
		clock->time_s = more;
		clock->capacity = capacity;
	}
	clock->time_s[clock->n++] = time_s;
	return 0;
}

/* Counts what the numbering of scans says; true if a new scan begins here. */
static bool new_scan(struct clock *clock, double sequence)
{
	bool first = isnan(clock->last_sequence), begins = first || sequence != clock->last_sequence;
	if (isnan(sequence))
		return false;
	if (first)
		clock->first_sequence = sequence;
	else if (sequence < clock->last_sequence)
		clock->sequence_backward++;
	else if (sequence > clock->last_sequence + 1) {
		clock->lost += sequence - clock->last_sequence - 1;
		clock->sequence_gaps++;
	}
	clock->last_sequence = sequence;
	return begins;
}

/* True if a row has the instant of the one before it, and its channel has not been read at that instant yet. */
static bool beside(struct recording *recording, double channel, double time_s)
{
	for (size_t c = 0; c < recording->channel_count; c++) {
		struct channel *own = &recording->channels[c];
		if (own->number != channel)
			continue;
		bool again = own->last_s == time_s;
		own->last_s = time_s;
		return !again && time_s == recording->clock.last_s;
	}
	return false;
}

static int add_clock(struct recording *recording, const tactus_table *block, size_t n)
{
	struct clock *clock = &recording->clock;
	const double *time_s = tactus_table_numbers(block, "time_s"), *sequence = tactus_table_numbers(block, "sequence");
	const double *channel = tactus_table_numbers(block, "channel");
	clock->has_time = clock->has_time || time_s;
	clock->has_sequence = clock->has_sequence || sequence;
	for (size_t i = 0; i < n; i++) {
		bool begins = sequence ? new_scan(clock, sequence[i]) : true;
		if (!time_s || isnan(time_s[i]))
			continue;
		if (!sequence && channel)
			begins = !beside(recording, channel[i], time_s[i]);
		clock->backward += time_s[i] < clock->last_s;
		clock->repeated += begins && time_s[i] == clock->last_s;
		clock->last_s = time_s[i];
		int error = begins ? add_instant(clock, time_s[i]) : 0;
		if (error)
			return error;
	}
	return 0;
}

static int add_block(struct recording *recording, const tactus_table *block)
{
	size_t n = tactus_table_rows(block);
	for (size_t c = 0; c < recording->column_count; c++) {
		struct column *column = &recording->columns[c];
		column->is_text = tactus_table_type(block, c) == TACTUS_COLUMN_TEXT;
		if (column->is_text)
			add_texts(column, tactus_table_texts(block, column->name), n);
		else
			add_numbers(column, tactus_table_numbers(block, column->name), n);
	}
	recording->rows += n;
	if (!recording->domain && n)
		recording->domain = tactus_domain_of(block);
	const double *channel = tactus_table_numbers(block, "channel");
	int error = channel ? add_channels(recording, channel, n) : 0;
	return error ? error : add_clock(recording, block, n);
}

static int by_number(const void *a, const void *b)
{
	double x = ((const struct channel *)a)->number, y = ((const struct channel *)b)->number;
	return (x > y) - (x < y);
}

static int gather(tactus_reader *reader, struct recording *recording)
{
	recording->block = tactus_reader_block(reader);
	recording->clock.last_s = recording->clock.last_sequence = recording->clock.first_sequence = NAN;
	recording->column_count = tactus_table_columns(recording->block);
	recording->columns = calloc(recording->column_count + 1, sizeof *recording->columns);
	if (!recording->columns)
		return TACTUS_ERR_MEMORY;
	for (size_t c = 0; c < recording->column_count; c++)
		recording->columns[c].name = tactus_table_name(recording->block, c);
	tactus_table *block;
	long rows;
	int error = 0;
	while (!error && (rows = tactus_reader_next(reader, 0, &block)) != 0)
		error = rows < 0 ? (int)rows : add_block(recording, block);
	if (recording->channels)
		qsort(recording->channels, recording->channel_count, sizeof *recording->channels, by_number);
	return error;
}

/* ---- the clock ---- */

struct rhythm {
	double start_s, end_s, step_s, rate_Hz, largest_step_s;
	size_t gaps; /* steps longer than one and a half of the usual one */
};

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Of instants in order; the array is used up. */
static struct rhythm find_rhythm(struct clock *clock)
{
	struct rhythm rhythm = {NAN, NAN, NAN, NAN, NAN, 0};
	double *steps = clock->time_s;
	if (!clock->n)
		return rhythm;
	rhythm.start_s = clock->time_s[0];
	rhythm.end_s = clock->time_s[clock->n - 1];
	if (clock->n < 2)
		return rhythm;
	for (size_t i = 0; i + 1 < clock->n; i++)
		steps[i] = clock->time_s[i + 1] - clock->time_s[i];
	qsort(steps, clock->n - 1, sizeof *steps, ascending);
	rhythm.step_s = steps[(clock->n - 1) / 2];
	rhythm.rate_Hz = rhythm.step_s > 0 ? 1 / rhythm.step_s : NAN;
	rhythm.largest_step_s = steps[clock->n - 2];
	for (size_t i = 0; i + 1 < clock->n; i++)
		rhythm.gaps += steps[i] > 1.5 * rhythm.step_s;
	return rhythm;
}

/* ---- text ---- */

static void print_columns(const struct recording *recording)
{
	printf("\n%-26s %10s %10s %14s %14s\n", "column", "values", "missing", "minimum", "maximum");
	for (size_t c = 0; c < recording->column_count; c++) {
		const struct column *column = &recording->columns[c];
		printf("%-26s %10zu %10zu", column->name, column->values, column->missing);
		if (!column->is_text && column->values)
			printf(" %14.7g %14.7g", column->minimum, column->maximum);
		for (size_t w = 0; column->is_text && w < column->word_count; w++)
			printf("%s%s %zu", w ? ", " : "  ", column->words[w].text, column->words[w].rows);
		puts(column->more_words ? ", …" : "");
	}
}

static void print_clock(const struct clock *clock, const struct rhythm *rhythm)
{
	if (!clock->has_time)
		printf("clock: none%s\n", clock->has_sequence ? "; `sequence` gives the order" : ", and the order is unknown");
	else if (clock->n > 1)
		printf("clock: %g s to %g s, usually %g s apart (%.6g Hz); %zu gap%s, longest %g s\n", rhythm->start_s,
			   rhythm->end_s, rhythm->step_s, rhythm->rate_Hz, rhythm->gaps, rhythm->gaps == 1 ? "" : "s",
			   rhythm->largest_step_s);
	if (clock->repeated || clock->backward)
		printf("       %zu times the same instant again, %zu times back in time\n", clock->repeated, clock->backward);
	if (clock->has_sequence && !isnan(clock->last_sequence))
		printf("scans: %.0f to %.0f, %.0f lost in %zu gap%s%s\n", clock->first_sequence, clock->last_sequence,
			   clock->lost, clock->sequence_gaps, clock->sequence_gaps == 1 ? "" : "s",
			   clock->sequence_backward ? "; the numbers go back" : "");
}

static void print_recording(const struct recording *recording, const struct rhythm *rhythm, const char *file)
{
	printf("%s: recording, %zu rows, ", strcmp(file, "-") ? file : "standard input", recording->rows);
	if (recording->domain)
		printf("domain %s\n", tactus_domain_name(recording->domain));
	else
		puts("its columns do not say which domain");
	if (recording->channel_count) {
		fputs("channels:", stdout);
		for (size_t c = 0; c < recording->channel_count; c++)
			printf(" %g (%zu rows)%s", recording->channels[c].number, recording->channels[c].rows,
				   c + 1 < recording->channel_count ? "," : "\n");
	}
	print_clock(&recording->clock, rhythm);
	print_columns(recording);
	const tactus_metadata *metadata = tactus_table_metadata(recording->block);
	if (tactus_metadata_count(metadata))
		puts("\nmetadata");
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++)
		printf("  %-28s %s\n", tactus_metadata_key(metadata, i), tactus_metadata_value(metadata, i));
}

/* ---- JSON ---- */

static void json_column(struct cli_json *json, const struct column *column)
{
	cli_json_object(json, NULL);
	cli_json_string(json, "name", column->name);
	cli_json_string(json, "type", column->is_text ? "text" : "number");
	cli_json_number(json, "values", (double)column->values);
	cli_json_number(json, "missing", (double)column->missing);
	if (column->is_text) {
		cli_json_object(json, "words");
		for (size_t w = 0; w < column->word_count; w++)
			cli_json_number(json, column->words[w].text, (double)column->words[w].rows);
		cli_json_close(json);
	} else {
		cli_json_number(json, "minimum", column->values ? column->minimum : NAN);
		cli_json_number(json, "maximum", column->values ? column->maximum : NAN);
	}
	cli_json_close(json);
}

static void json_clock(struct cli_json *json, const struct clock *clock, const struct rhythm *rhythm)
{
	cli_json_object(json, "clock");
	cli_json_number(json, "start_s", rhythm->start_s);
	cli_json_number(json, "end_s", rhythm->end_s);
	cli_json_number(json, "step_s", rhythm->step_s);
	cli_json_number(json, "rate_Hz", rhythm->rate_Hz);
	cli_json_number(json, "gaps", clock->has_time ? (double)rhythm->gaps : NAN);
	cli_json_number(json, "largest_step_s", rhythm->largest_step_s);
	cli_json_number(json, "repeated", clock->has_time ? (double)clock->repeated : NAN);
	cli_json_number(json, "backward", clock->has_time ? (double)clock->backward : NAN);
	cli_json_close(json);
	cli_json_object(json, "scans");
	cli_json_number(json, "first", clock->first_sequence);
	cli_json_number(json, "last", clock->last_sequence);
	cli_json_number(json, "lost", clock->has_sequence ? clock->lost : NAN);
	cli_json_number(json, "gaps", clock->has_sequence ? (double)clock->sequence_gaps : NAN);
	cli_json_close(json);
}

static int json_recording(const struct recording *recording, const struct rhythm *rhythm, const char *file)
{
	struct cli_json *json = cli_json_begin();
	cli_json_string(json, "kind", "recording");
	cli_json_string(json, "file", file);
	cli_json_string(json, "domain", recording->domain ? tactus_domain_name(recording->domain) : NULL);
	cli_json_number(json, "rows", (double)recording->rows);
	cli_json_array(json, "channels");
	for (size_t c = 0; c < recording->channel_count; c++) {
		cli_json_object(json, NULL);
		cli_json_number(json, "channel", recording->channels[c].number);
		cli_json_number(json, "rows", (double)recording->channels[c].rows);
		cli_json_close(json);
	}
	cli_json_close(json);
	json_clock(json, &recording->clock, rhythm);
	cli_json_array(json, "columns");
	for (size_t c = 0; c < recording->column_count; c++)
		json_column(json, &recording->columns[c]);
	cli_json_close(json);
	cli_json_object(json, "metadata");
	const tactus_metadata *metadata = tactus_table_metadata(recording->block);
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++)
		cli_json_string(json, tactus_metadata_key(metadata, i), tactus_metadata_value(metadata, i));
	return cli_json_end(json);
}

int cli_show_recording(const struct cli *cli, const char *file)
{
	struct recording recording = {0};
	tactus_reader *reader;
	tactus_read_options options = cli_read_options(cli);
	int error = tactus_reader_open(file, &options, &reader);
	if (error)
		return cli_fail(cli, error);
	error = gather(reader, &recording);
	int status = cli_fail(cli, error);
	if (!error) {
		struct rhythm rhythm = find_rhythm(&recording.clock);
		if (cli_has(cli, "json"))
			status = json_recording(&recording, &rhythm, file);
		else
			print_recording(&recording, &rhythm, file);
	}
	free(recording.columns);
	free(recording.channels);
	free(recording.clock.time_s);
	tactus_reader_close(reader);
	return status;
}
