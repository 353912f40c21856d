/* Values in Modbus registers and bits: coding, and the fewest requests that read many of them. */
#include <math.h>
#include <stdlib.h>

#include "core/core.h"
#include "device/modbus_value.h"

enum { WORDS_MAX = 4 };

bool tactus_value_is_bits(enum tactus_modbus_table table)
{
	return table == TACTUS_MODBUS_COILS || table == TACTUS_MODBUS_DISCRETE;
}

int tactus_value_size(const tactus_value *value)
{
	static const int sizes[] = {1, 1, 2, 2, 4, 4, 2, 4, 1};
	return sizes[value->type];
}

/* ---- coding ---- */

static uint16_t swap(uint16_t word)
{
	return (uint16_t)(word << 8 | word >> 8);
}

static bool swaps_words(enum tactus_value_order order)
{
	return order == TACTUS_ORDER_CDAB || order == TACTUS_ORDER_DCBA;
}

static bool swaps_bytes(enum tactus_value_order order)
{
	return order == TACTUS_ORDER_BADC || order == TACTUS_ORDER_DCBA;
}

uint64_t tactus_value_raw(const tactus_value *value, const uint16_t *registers)
{
	const int n = tactus_value_size(value);
	uint64_t raw = 0;
	for (int i = 0; i < n; i++) {
		const uint16_t word = registers[swaps_words(value->order) ? n - 1 - i : i];
		raw = raw << 16 | (swaps_bytes(value->order) ? swap(word) : word);
	}
	return raw;
}

static double f32(uint64_t raw)
{
	const uint32_t bits = (uint32_t)raw;
	float number;
	memcpy(&number, &bits, sizeof(number));
	return (double)number;
}

static double f64(uint64_t raw)
{
	double number;
	memcpy(&number, &raw, sizeof(number));
	return number;
}

double tactus_value_get(const tactus_value *value, const uint16_t *registers)
{
	const uint64_t raw = tactus_value_raw(value, registers);
	double number = NAN;
	switch (value->type) {
	case TACTUS_VALUE_U16:
	case TACTUS_VALUE_U32:
	case TACTUS_VALUE_U64:
		number = (double)raw;
		break;
	case TACTUS_VALUE_I16:
		number = (int16_t)raw;
		break;
	case TACTUS_VALUE_I32:
		number = (int32_t)raw;
		break;
	case TACTUS_VALUE_I64:
		number = (double)(int64_t)raw;
		break;
	case TACTUS_VALUE_F32:
		number = f32(raw);
		break;
	case TACTUS_VALUE_F64:
		number = f64(raw);
		break;
	case TACTUS_VALUE_BIT:
		number = (double)(raw >> value->bit & 1);
		break;
	}
	return isfinite(number) ? number * value->scale + value->offset : NAN;
}

/* Whole numbers from `least` to `most`. */
static bool put_whole(double number, double least, double most, uint64_t *raw)
{
	const double whole = round(number);
	if (!(whole >= least && whole <= most))
		return false;
	*raw = whole < 0 ? (uint64_t)(int64_t)whole : (uint64_t)whole;
	return true;
}

static bool put_raw(enum tactus_value_type type, double number, uint64_t *raw)
{
	const float single = (float)number;
	uint32_t bits;
	switch (type) {
	case TACTUS_VALUE_U16:
		return put_whole(number, 0, UINT16_MAX, raw);
	case TACTUS_VALUE_I16:
		return put_whole(number, INT16_MIN, INT16_MAX, raw);
	case TACTUS_VALUE_U32:
		return put_whole(number, 0, UINT32_MAX, raw);
	case TACTUS_VALUE_I32:
		return put_whole(number, INT32_MIN, INT32_MAX, raw);
	case TACTUS_VALUE_U64:
		return put_whole(number, 0, 0x1p64 - 2048, raw);
	case TACTUS_VALUE_I64:
		return put_whole(number, -0x1p63, 0x1p63 - 1024, raw);
	case TACTUS_VALUE_F32:
		memcpy(&bits, &single, sizeof(bits));
		*raw = bits;
		return isfinite(single);
	case TACTUS_VALUE_F64:
		memcpy(raw, &number, sizeof(*raw));
		return isfinite(number);
	default:
		return put_whole(number, 0, 1, raw);
	}
}

int tactus_value_put(const tactus_value *value, double number, uint16_t *registers)
{
	const int n = tactus_value_size(value);
	uint64_t raw = 0;
	if (!put_raw(value->type, (number - value->offset) / value->scale, &raw))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%g does not fit into the device's register %d", number,
						   value->address);
	for (int i = n - 1; i >= 0; i--, raw >>= 16)
		registers[swaps_words(value->order) ? n - 1 - i : i] =
			swaps_bytes(value->order) ? swap((uint16_t)raw) : (uint16_t)raw;
	return TACTUS_OK;
}

/* ---- polls ---- */

static int every(const tactus_value *value)
{
	return value->every > 1 ? value->every : 1;
}

static int compare(const tactus_value *a, const tactus_value *b)
{
	if (every(a) != every(b))
		return every(a) - every(b);
	return a->table != b->table ? (int)a->table - (int)b->table : a->address - b->address;
}

/* Insertion sort of indices: a few hundred at most, once, and mostly in order. */
static void sort(const tactus_value *const *values, size_t n, size_t *order)
{
	for (size_t i = 0; i < n; i++) {
		size_t k = i;
		for (; k > 0 && compare(values[order[k - 1]], values[i]) > 0; k--)
			order[k] = order[k - 1];
		order[k] = i;
	}
}

/* Whether one request can read on as far as this value's end. */
static bool reaches(const tactus_poll_request *request, const tactus_value *value, int max_gap)
{
	const size_t most = tactus_value_is_bits(value->table) ? TACTUS_MODBUS_READ_BITS_MAX : TACTUS_MODBUS_READ_MAX;
	const int end = request->address + (int)request->count;
	return value->table == request->table && every(value) == request->every && value->address - end <= max_gap &&
		   (size_t)(value->address + tactus_value_size(value) - request->address) <= most;
}

/* The request that reads all of a value already, NULL if none does. */
static const tactus_poll_request *covering(const tactus_poll *poll, const tactus_value *value)
{
	for (size_t i = 0; i < poll->count; i++) {
		const tactus_poll_request *r = &poll->requests[i];
		if (r->table == value->table && r->address <= value->address &&
			value->address + tactus_value_size(value) <= r->address + (int)r->count)
			return r;
	}
	return NULL;
}

/* From the lowest address on, each request as long as it can be: no other division needs fewer. */
static void divide(tactus_poll *poll, const tactus_value *const *values, size_t n, int max_gap, const size_t *order,
				   size_t *places)
{
	for (size_t i = 0; i < n; i++) {
		const tactus_value *value = values[order[i]];
		const tactus_poll_request *there = covering(poll, value);
		if (there != NULL) {
			places[order[i]] = there->at + (size_t)(value->address - there->address);
			continue;
		}
		tactus_poll_request *request = poll->count > 0 ? &poll->requests[poll->count - 1] : NULL;
		if (request == NULL || !reaches(request, value, max_gap)) {
			request = &poll->requests[poll->count++];
			*request = (tactus_poll_request){
				.table = value->table, .address = value->address, .at = poll->word_count, .every = every(value)};
		}
		const size_t end = (size_t)(value->address + tactus_value_size(value) - request->address);
		if (end > request->count) {
			poll->word_count += end - request->count;
			request->count = end;
		}
		places[order[i]] = request->at + (size_t)(value->address - request->address);
	}
}

int tactus_poll_make(tactus_poll *poll, const tactus_value *const *values, size_t n, int max_gap, size_t *places)
{
	size_t *order = calloc(n + 1, sizeof(*order));
	*poll = (tactus_poll){.requests = calloc(n + 1, sizeof(*poll->requests))};
	if (order != NULL && poll->requests != NULL) {
		sort(values, n, order);
		divide(poll, values, n, max_gap, order, places);
		poll->words = calloc(poll->word_count + WORDS_MAX, sizeof(*poll->words));
	}
	free(order);
	if (poll->words != NULL)
		return TACTUS_OK;
	tactus_poll_clear(poll);
	return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

void tactus_poll_clear(tactus_poll *poll)
{
	free(poll->requests);
	free(poll->words);
	*poll = (tactus_poll){0};
}

int tactus_poll_read(const tactus_poll *poll, size_t i, tactus_modbus *link)
{
	const tactus_poll_request *r = &poll->requests[i];
	uint8_t bits[TACTUS_MODBUS_READ_BITS_MAX];
	if (!tactus_value_is_bits(r->table))
		return tactus_modbus_read(link, r->table, r->address, r->count, poll->words + r->at);
	const int code = tactus_modbus_read_bits(link, r->table, r->address, r->count, bits);
	for (size_t k = 0; k < r->count && code >= 0; k++)
		poll->words[r->at + k] = bits[k];
	return code;
}

int tactus_poll_run(const tactus_poll *poll, tactus_modbus *link)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < poll->count && code >= 0; i++) {
		tactus_poll_request *r = &poll->requests[i];
		if (r->rest > 0) {
			r->rest--;
			continue;
		}
		code = tactus_poll_read(poll, i, link);
		r->rest = code >= 0 ? r->every - 1 : 0;
	}
	return code;
}

void tactus_poll_restart(tactus_poll *poll)
{
	for (size_t i = 0; i < poll->count; i++)
		poll->requests[i].rest = 0;
}
