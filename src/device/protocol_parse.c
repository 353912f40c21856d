/* Reads the loading language. Grammar: steps separated by commas; a step is a word and its arguments, or
 * `repeat COUNT ( steps )`. Errors show the text with carets under the word that is wrong. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/protocol.h"

enum { DEPTH_MAX = 16, STEPS_MAX = 100000, WORD_MAX = 64, VIEW_MAX = 160 };

static const double DURATION_MAX_S = 1e10, LEVELS_MAX = 1e12;

typedef struct {
	const char *text;
	size_t position;      /* of the character after the token */
	size_t begin, length; /* the present token; length 0 at the end */
	uint64_t seed;
	tactus_protocol *protocol;
	int depth;
} parser;

static bool is_space(char c)
{
	return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* The next token: a comma, a parenthesis, or a word. */
static void advance(parser *p)
{
	while (is_space(p->text[p->position]))
		p->position++;
	p->begin = p->position;
	if (p->text[p->position] != '\0' && strchr(",()", p->text[p->position]) != NULL)
		p->position++;
	else
		p->position += strcspn(p->text + p->position, " \t\n\r,()");
	p->length = p->position - p->begin;
}

static bool token_is(const parser *p, const char *what)
{
	return p->length == strlen(what) && memcmp(p->text + p->begin, what, p->length) == 0;
}

static bool token_ends_step(const parser *p)
{
	return p->length == 0 || strchr(",()", p->text[p->begin]) != NULL;
}

/* Columns that n bytes of UTF-8 take. */
static size_t columns(const char *text, size_t n)
{
	size_t count = 0;
	for (size_t i = 0; i < n; i++)
		count += ((unsigned char)text[i] & 0xC0) != 0x80;
	return count;
}

/* The message, then the text (of a long one the part around the fault), then carets under the present token. */
static int fail_at(const parser *p, const char *message)
{
	const size_t skip = p->begin > VIEW_MAX / 2 ? p->begin - VIEW_MAX / 2 : 0;
	char *line = tactus_strndup(p->text + skip, VIEW_MAX);
	char carets[WORD_MAX + 1];
	size_t width = columns(p->text + p->begin, p->length);
	if (line == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (char *c = line; *c != '\0'; c++)
		if (is_space(*c))
			*c = ' ';
	width = width < 1 ? 1 : width > WORD_MAX ? WORD_MAX : width;
	memset(carets, '^', width);
	carets[width] = '\0';
	const int code = tactus_fail(TACTUS_ERR_ARGUMENT, "protocol: %s\n  %s\n  %*s%s", message, line,
								 (int)columns(p->text + skip, p->begin - skip), "", carets);
	free(line);
	return code;
}

static int fail_word(const parser *p, const char *before, const char *after)
{
	char *message = p->length > 0 ? tactus_asprintf("%s'%.*s'%s", before, (int)p->length, p->text + p->begin, after)
								  : tactus_asprintf("%sthe end%s", before, after);
	if (message == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const int code = fail_at(p, message);
	free(message);
	return code;
}

/* A quantity in part of the present token. */
static int parse_part(parser *p, size_t offset, size_t length, const char *unit, double *value)
{
	char word[WORD_MAX];
	parser part = *p;
	part.begin += offset;
	part.length = length;
	if (length >= sizeof(word))
		return fail_at(&part, "this word is too long");
	memcpy(word, p->text + part.begin, length);
	word[length] = '\0';
	if (length == 0 || tactus_parse_quantity(word, unit, value) < 0 || !isfinite(*value)) {
		char after[48];
		const char *kind = unit[0] == 'N'   ? "force, such as 3N"
						   : unit[0] == 's' ? "time, such as 2s"
											: "frequency, such as 4Hz";
		snprintf(after, sizeof(after), " is not a %s", kind);
		part.length = length > 0 ? length : 1;
		return fail_word(&part, "", after);
	}
	return TACTUS_OK;
}

/* A..B, where `returns` is not NULL also A..B..A, where `previous` is not NULL also B alone. */
static int parse_range(parser *p, tactus_protocol_step *step, const double *previous, bool *returns)
{
	const char *text = p->text + p->begin;
	const char *dots = memmem(text, p->length, "..", 2);
	if (dots == NULL && previous != NULL) {
		step->from_N = *previous;
		return parse_part(p, 0, p->length, "N", &step->to_N);
	}
	if (dots == NULL)
		return fail_word(p, "", " is not a range of forces, such as 0N..7N");
	const size_t first = (size_t)(dots - text), rest = first + 2;
	const char *again = memmem(text + rest, p->length - rest, "..", 2);
	const size_t end = again != NULL ? (size_t)(again - text) : p->length;
	double back_N = 0;
	int code = parse_part(p, 0, first, "N", &step->from_N);
	if (code == TACTUS_OK)
		code = parse_part(p, rest, end - rest, "N", &step->to_N);
	if (code < 0 || again == NULL)
		return code;
	if (returns == NULL)
		return fail_word(p, "", " has three ends; a range here is FROM..TO");
	code = parse_part(p, end + 2, p->length - end - 2, "N", &back_N);
	if (code == TACTUS_OK && back_N != step->from_N)
		return fail_word(p, "", " must return to where it starts: FROM..TO..FROM");
	*returns = true;
	return code;
}

static int parse_positive(parser *p, const char *unit, double *value)
{
	const int code = parse_part(p, 0, p->length, unit, value);
	return code == TACTUS_OK && !(*value > 0) ? fail_word(p, "", " must be more than zero") : code;
}

static int parse_argument(parser *p, char kind, tactus_protocol_step *step)
{
	switch (kind) {
	case 'f':
		return parse_positive(p, "Hz", &step->frequency_Hz);
	case 'F':
		return strcmp(step->word->name, "staircase") == 0 ? parse_positive(p, "N", &step->force_N)
														  : parse_part(p, 0, p->length, "N", &step->force_N);
	case 'T':
		step->time_s = step->duration_s; /* the time before the last is that of a level */
		return parse_positive(p, "s", &step->duration_s);
	case 'S':
		return parse_range(p, step, NULL, &step->returns);
	case '?':
		return parse_range(p, step, &p->protocol->end_N, NULL);
	default:
		return parse_range(p, step, NULL, NULL);
	}
}

/* Appends a step and keeps account of the whole: its length, its extremes, the load that it ends with. */
static int append(parser *p, tactus_protocol_step step)
{
	tactus_protocol *protocol = p->protocol;
	if (protocol->count == STEPS_MAX)
		return fail_at(p, "this protocol has too many steps");
	if (protocol->count == protocol->capacity) {
		const size_t capacity = protocol->capacity > 0 ? 2 * protocol->capacity : 16;
		tactus_protocol_step *steps = realloc(protocol->steps, capacity * sizeof(*steps));
		if (steps == NULL)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		protocol->steps = steps;
		protocol->capacity = capacity;
	}
	if (!(protocol->duration_s + step.duration_s < DURATION_MAX_S) ||
		(step.time_s > 0 && step.duration_s > LEVELS_MAX * step.time_s))
		return fail_at(p, "this step never ends");
	step.start_s = protocol->duration_s;
	step.number = protocol->count;
	step.seed = p->seed;
	const bool ranged = strpbrk(step.word->signature, "RS?") != NULL;
	const double low = ranged ? fmin(step.from_N, step.to_N) : fmin(0, step.force_N);
	const double high = ranged ? fmax(step.from_N, step.to_N) : step.force_N;
	protocol->minimum_N = protocol->count > 0 ? fmin(protocol->minimum_N, low) : low;
	protocol->maximum_N = protocol->count > 0 ? fmax(protocol->maximum_N, high) : high;
	protocol->end_N = step.word->force_N(&step, step.duration_s * (1 - 1e-12));
	if (strcmp(step.word->name, "ramp") == 0)
		protocol->end_N = step.to_N;
	protocol->duration_s += step.duration_s;
	protocol->steps[protocol->count++] = step;
	return TACTUS_OK;
}

static int parse_steps(parser *p);

static int parse_repeat(parser *p)
{
	char *end = NULL;
	advance(p);
	const long count = strtol(p->text + p->begin, &end, 10);
	if (end != p->text + p->position || count < 1 || count > STEPS_MAX)
		return fail_word(p, "", " is not a number of repetitions");
	advance(p);
	if (!token_is(p, "("))
		return fail_word(p, "'(' must stand here, not ", ": repeat COUNT (steps)");
	if (++p->depth > DEPTH_MAX)
		return fail_at(p, "too many parentheses inside each other");
	const size_t inside = p->position;
	int code = TACTUS_OK;
	for (long i = 0; i < count && code == TACTUS_OK; i++) {
		p->position = inside; /* each round is read again: what is random or starts at the present load differs */
		advance(p);
		code = parse_steps(p);
		if (code == TACTUS_OK && !token_is(p, ")"))
			code = fail_word(p, "')' must stand here, not ", "");
	}
	p->depth--;
	if (code == TACTUS_OK)
		advance(p);
	return code;
}

static int fail_unknown_word(const parser *p)
{
	char names[160] = " is not a step (";
	size_t length = strlen(names);
	for (const tactus_protocol_word *word = tactus_protocol_words; word->name != NULL; word++)
		length += (size_t)snprintf(names + length, sizeof(names) - length, "%s, ", word->name);
	snprintf(names + length, sizeof(names) - length, "repeat)");
	return fail_word(p, "", names);
}

static const tactus_protocol_word *step_word(const parser *p)
{
	for (const tactus_protocol_word *word = tactus_protocol_words; word->name != NULL; word++)
		if (token_is(p, word->name))
			return word;
	return NULL;
}

/* What follows a step that is complete: the next one, or an argument that no step has. */
static int fail_no_comma(const parser *p, const char *usage)
{
	const bool step = token_is(p, "repeat") || step_word(p) != NULL;
	return step ? fail_word(p, "a comma must stand before ", "")
				: fail_word(p, "a comma must stand here, or nothing, not ", usage);
}

static int parse_step(parser *p)
{
	tactus_protocol_step step = {.word = step_word(p)};
	if (token_is(p, "repeat"))
		return parse_repeat(p);
	if (step.word == NULL)
		return token_ends_step(p) ? fail_word(p, "a step must stand here, not ", "") : fail_unknown_word(p);
	char usage[96];
	snprintf(usage, sizeof(usage), " (%s)", step.word->usage);
	for (const char *kind = step.word->signature; *kind != '\0'; kind++) {
		advance(p);
		if (token_ends_step(p))
			return fail_word(p, "something is missing before ", usage);
		const int code = parse_argument(p, *kind, &step);
		if (code < 0)
			return code;
	}
	if (step.word->duration_s != NULL) {
		step.time_s = step.duration_s;
		step.duration_s = step.word->duration_s(&step);
	}
	const int code = append(p, step);
	advance(p);
	if (code == TACTUS_OK && !token_ends_step(p))
		return fail_no_comma(p, usage);
	return code;
}

static int parse_steps(parser *p)
{
	for (;;) {
		const int code = parse_step(p);
		if (code < 0 || !token_is(p, ","))
			return code;
		advance(p);
	}
}

int tactus_protocol_parse(const char *text, uint64_t seed, tactus_protocol **protocol)
{
	parser p = {.text = text, .seed = seed, .protocol = calloc(1, sizeof(tactus_protocol))};
	if (p.protocol == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	advance(&p);
	int code = parse_steps(&p);
	if (code == TACTUS_OK && p.length > 0)
		code = token_is(&p, ")") ? fail_word(&p, "", " has no '(' before it") : fail_no_comma(&p, "");
	if (code < 0) {
		tactus_protocol_free(p.protocol);
		return code;
	}
	*protocol = p.protocol;
	return TACTUS_OK;
}
