/* HID report descriptors: one pass over the items, nothing allocated, every size checked. */
#include <string.h>

#include "core/core.h"
#include "device/hid_report.h"

enum {
	STACK_MAX = 8,   /* pushed globals */
	USAGES_MAX = 64, /* usages and ranges of one main item; what is beyond has no name */
	DEPTH_MAX = 64,  /* nested collections */
	BITS_MAX = TACTUS_HID_REPORT_MAX * 8
};

/* Item prefixes without their size (6.2.2.4 to 6.2.2.8). */
enum {
	ITEM_INPUT = 0x80,
	ITEM_OUTPUT = 0x90,
	ITEM_COLLECTION = 0xA0,
	ITEM_FEATURE = 0xB0,
	ITEM_END = 0xC0,
	ITEM_PAGE = 0x04,
	ITEM_MINIMUM = 0x14,
	ITEM_MAXIMUM = 0x24,
	ITEM_SIZE = 0x74,
	ITEM_ID = 0x84,
	ITEM_COUNT = 0x94,
	ITEM_PUSH = 0xA4,
	ITEM_POP = 0xB4,
	ITEM_USAGE = 0x08,
	ITEM_USAGE_MINIMUM = 0x18,
	ITEM_USAGE_MAXIMUM = 0x28,
	ITEM_DELIMITER = 0xA8,
	ITEM_LONG = 0xFE
};
enum { FLAG_CONSTANT = 1, FLAG_VARIABLE = 2 };

typedef struct {
	uint32_t page;
	int32_t minimum, maximum;
	uint32_t maximum_unsigned; /* as written: 0xff in one byte may mean 255 */
	uint32_t size, count;
	uint8_t id;
} globals;

typedef struct {
	uint32_t first, last;
} range;

typedef struct {
	globals now, stack[STACK_MAX];
	size_t pushed, depth;
	range usages[USAGES_MAX];
	size_t usage_count;
	uint32_t usage_minimum;
	bool has_minimum, delimited, alternative; /* inside a set of alternative usages; its first was taken */
	bool numbered;                            /* some report has a number */
	uint32_t bits[3][256];                    /* of each report so far */
	/* what is looked for */
	enum tactus_hid_kind kind;
	uint32_t usage;
	tactus_hid_field *field;
	bool found;
} parser;

static int malformed(size_t at, const char *what)
{
	return tactus_fail(TACTUS_ERR_INPUT, "HID report descriptor, byte %zu: %s", at, what);
}

static int32_t as_signed(uint32_t value, size_t bytes)
{
	if (bytes == 0 || bytes >= 4)
		return (int32_t)value;
	const uint32_t sign = UINT32_C(1) << (8 * bytes - 1);
	return (int32_t)((value ^ sign) - sign);
}

static void clear_locals(parser *p)
{
	p->usage_count = 0;
	p->has_minimum = p->delimited = p->alternative = false;
}

static void add_usages(parser *p, uint32_t first, uint32_t last)
{
	if (p->alternative)
		return;
	p->alternative = p->delimited;
	if (p->usage_count < USAGES_MAX && first <= last)
		p->usages[p->usage_count++] = (range){first, last};
}

/* A usage of one or two bytes is of the present page. */
static uint32_t full_usage(const parser *p, uint32_t value, size_t bytes)
{
	return bytes == 4 ? value : TACTUS_HID_USAGE(p->now.page, value);
}

/* Which element of the main item has the usage that is looked for: the last name goes on to the end (6.2.2.8). */
static bool element_of(const parser *p, uint32_t *element)
{
	uint64_t before = 0;
	for (size_t i = 0; i < p->usage_count; i++) {
		const range *usages = &p->usages[i];
		if (p->usage >= usages->first && p->usage <= usages->last) {
			const uint64_t at = before + (p->usage - usages->first);
			*element = (uint32_t)at;
			return at < p->now.count;
		}
		before += (uint64_t)usages->last - usages->first + 1;
	}
	return false;
}

static int32_t logical_maximum(const globals *g)
{
	const bool wrapped = g->minimum >= 0 && g->maximum < g->minimum; /* written too short for its sign */
	return wrapped && g->maximum_unsigned <= INT32_MAX ? (int32_t)g->maximum_unsigned : g->maximum;
}

/* Input, output or feature: counts its bits, and looks whether the field is in it. */
static int take_main(parser *p, enum tactus_hid_kind kind, uint32_t flags, size_t at)
{
	uint32_t *bits = &p->bits[kind][p->now.id], element;
	const uint64_t added = (uint64_t)p->now.size * p->now.count;
	if (added > BITS_MAX || *bits + added > BITS_MAX)
		return malformed(at, "the report is too long");
	if (!p->found && p->field != NULL && kind == p->kind &&
		(flags & (FLAG_CONSTANT | FLAG_VARIABLE)) == FLAG_VARIABLE && p->now.size >= 1 && p->now.size <= 32 &&
		element_of(p, &element)) {
		p->found = true;
		*p->field = (tactus_hid_field){.kind = kind,
									   .report = p->now.id,
									   .bit = *bits + element * p->now.size,
									   .bits = p->now.size,
									   .logical_minimum = p->now.minimum,
									   .logical_maximum = logical_maximum(&p->now)};
	}
	*bits += (uint32_t)added;
	clear_locals(p);
	return TACTUS_OK;
}

static int take_global(parser *p, int item, uint32_t value, size_t bytes, size_t at)
{
	switch (item) {
	case ITEM_PAGE:
		p->now.page = value & 0xFFFF;
		break;
	case ITEM_MINIMUM:
		p->now.minimum = as_signed(value, bytes);
		break;
	case ITEM_MAXIMUM:
		p->now.maximum = as_signed(value, bytes);
		p->now.maximum_unsigned = value;
		break;
	case ITEM_SIZE:
		p->now.size = value;
		break;
	case ITEM_COUNT:
		p->now.count = value;
		break;
	case ITEM_ID:
		if (value == 0 || value > 255)
			return malformed(at, "a report's number is from 1 to 255");
		p->now.id = (uint8_t)value;
		p->numbered = true;
		break;
	case ITEM_PUSH:
		if (p->pushed == STACK_MAX)
			return malformed(at, "too many pushes");
		p->stack[p->pushed++] = p->now;
		break;
	case ITEM_POP:
		if (p->pushed == 0)
			return malformed(at, "a pop without a push");
		p->now = p->stack[--p->pushed];
		break;
	default:
		break; /* units, exponents, physical ranges: not needed */
	}
	return TACTUS_OK;
}

static void take_local(parser *p, int item, uint32_t value, size_t bytes)
{
	const uint32_t usage = full_usage(p, value, bytes);
	switch (item) {
	case ITEM_USAGE:
		add_usages(p, usage, usage);
		break;
	case ITEM_USAGE_MINIMUM:
		p->usage_minimum = usage;
		p->has_minimum = true;
		break;
	case ITEM_USAGE_MAXIMUM:
		if (p->has_minimum)
			add_usages(p, p->usage_minimum, usage);
		p->has_minimum = false;
		break;
	case ITEM_DELIMITER:
		p->delimited = value == 1;
		p->alternative = false;
		break;
	default:
		break; /* designators and strings */
	}
}

static int take_item(parser *p, int item, uint32_t value, size_t bytes, size_t at)
{
	switch (item) {
	case ITEM_INPUT:
		return take_main(p, TACTUS_HID_INPUT, value, at);
	case ITEM_OUTPUT:
		return take_main(p, TACTUS_HID_OUTPUT, value, at);
	case ITEM_FEATURE:
		return take_main(p, TACTUS_HID_FEATURE, value, at);
	case ITEM_COLLECTION:
		clear_locals(p);
		return ++p->depth > DEPTH_MAX ? malformed(at, "collections are nested too deep") : TACTUS_OK;
	case ITEM_END:
		clear_locals(p);
		return p->depth-- == 0 ? malformed(at, "the end of no collection") : TACTUS_OK;
	default:
		break;
	}
	if ((item & 0x0C) == 0x04)
		return take_global(p, item, value, bytes, at);
	if ((item & 0x0C) == 0x08)
		take_local(p, item, value, bytes);
	return TACTUS_OK;
}

static int parse(parser *p, const uint8_t *descriptor, size_t size)
{
	static const size_t sizes[] = {0, 1, 2, 4};
	int code = TACTUS_OK;
	size_t at = 0;
	if (size > TACTUS_HID_DESCRIPTOR_MAX)
		return malformed(TACTUS_HID_DESCRIPTOR_MAX, "the descriptor is too long");
	while (at < size && code >= 0) {
		const uint8_t prefix = descriptor[at];
		const bool is_long = prefix == ITEM_LONG;
		const size_t begin = at + (is_long ? 3 : 1),
					 bytes = is_long ? (at + 1 < size ? descriptor[at + 1] : 0u) : sizes[prefix & 3];
		uint32_t value = 0;
		if (begin > size || bytes > size - begin)
			return malformed(at, "an item is cut short");
		for (size_t i = 0; i < bytes && i < 4; i++)
			value |= (uint32_t)descriptor[begin + i] << (8 * i);
		if (!is_long)
			code = take_item(p, prefix & ~3, value, bytes, at);
		at = begin + bytes;
	}
	if (code >= 0 && p->depth != 0)
		code = malformed(size, "a collection is left open");
	return code;
}

int tactus_hid_find(const uint8_t *descriptor, size_t size, enum tactus_hid_kind kind, uint32_t usage,
					tactus_hid_field *field)
{
	tactus_hid_field found = {0};
	parser p = {.kind = kind, .usage = usage, .field = &found};
	const int code = parse(&p, descriptor, size);
	if (code < 0 || !p.found)
		return code;
	*field = found;
	return 1;
}

int tactus_hid_length(const uint8_t *descriptor, size_t size, enum tactus_hid_kind kind, uint8_t report)
{
	parser p = {0};
	const int code = parse(&p, descriptor, size);
	if (code < 0 || p.bits[kind][report] == 0)
		return code;
	return (int)((p.bits[kind][report] + 7) / 8) + (p.numbered ? 1 : 0);
}

/* The bytes behind the report's number; NULL if the field is not in this report. */
static const uint8_t *payload(const tactus_hid_field *field, const uint8_t *report, size_t length)
{
	const size_t number = field->report != 0 ? 1 : 0;
	if (length < number || (number != 0 && report[0] != field->report))
		return NULL;
	return ((size_t)field->bit + field->bits + 7) / 8 <= length - number ? report + number : NULL;
}

bool tactus_hid_get(const tactus_hid_field *field, const uint8_t *report, size_t length, int32_t *value)
{
	const uint8_t *bytes = payload(field, report, length);
	uint64_t raw = 0;
	if (bytes == NULL || field->bits == 0 || field->bits > 32)
		return false;
	for (unsigned i = 0; i < field->bits; i++)
		raw |= (uint64_t)(bytes[(field->bit + i) / 8] >> ((field->bit + i) % 8) & 1) << i;
	if (field->logical_minimum < 0 && (raw >> (field->bits - 1) & 1) != 0)
		raw |= ~UINT64_C(0) << field->bits;
	*value = (int32_t)(uint32_t)raw;
	return true;
}

bool tactus_hid_put(const tactus_hid_field *field, uint8_t *report, size_t length, int32_t value)
{
	if (length == 0 || value < field->logical_minimum || value > field->logical_maximum)
		return false;
	if (field->report != 0)
		report[0] = field->report;
	if (payload(field, report, length) == NULL)
		return false;
	uint8_t *bytes = report + (field->report != 0 ? 1 : 0);
	for (unsigned i = 0; i < field->bits; i++) {
		const unsigned at = field->bit + i;
		const uint8_t mask = (uint8_t)(1u << (at % 8));
		bytes[at / 8] = ((uint32_t)value >> i & 1) != 0 ? bytes[at / 8] | mask : bytes[at / 8] & (uint8_t)~mask;
	}
	return true;
}
