/*
 * Any bytes as what devices send: the first says to which parser they go. Nothing is read past their end, what is given
 * as good is a number, and the same bytes give the same whether they come at once or one by one.
 */
#include <math.h>
#include <string.h>

#include "fuzz.h"

#include "device/ati_records.h"
#include "device/hid_report.h"
#include "device/labjack_packet.h"
#include "device/lines.h"
#include "device/mcc_protocol.h"
#include "device/modbus.h"
#include "device/modbus_profile.h"
#include "device/robotiq_frames.h"
#include "device/scale.h"
#include "device/uri.h"

enum { TEXT_MAX = 4096 };

/* The bytes as text of their own, so that a read past the end is seen. Free it. */
static char *as_text(const uint8_t *data, size_t size)
{
	char *text = malloc(size + 1);
	if (text == NULL)
		abort();
	memcpy(text, data, size);
	text[size] = '\0';
	return text;
}

/* ---- lines of text: columns up to the first zero or line end, then lines ---- */

static void read_lines(const uint8_t *data, size_t size)
{
	char *text = as_text(data, size);
	tactus_lines lines, header;
	double values[TACTUS_LINE_FIELDS_MAX];
	const size_t head = strcspn(text, "\n");
	char *columns = as_text(data, head);
	if (tactus_lines_parse(columns, &lines) < 0) {
		FUZZ_HOLDS(*tactus_error_message());
		tactus_lines_parse("a,b@1*2,-,c/3", &lines);
	}
	for (size_t at = 0; at < size; at++) {
		const char *end = memchr(text + at, '\n', size - at);
		const size_t length = end != NULL ? (size_t)(end - text) - at : size - at;
		if (tactus_lines_read(&lines, text + at, length, values))
			for (size_t i = 0; i < lines.count; i++)
				FUZZ_HOLDS(!isinf(values[i]) || fabs(lines.fields[i].scale) != 1);
		if (tactus_lines_header(text + at, length, &header))
			FUZZ_HOLDS(header.count > 0 && header.count <= TACTUS_LINE_FIELDS_MAX);
		at += length;
	}
	free(columns);
	free(text);
}

static void read_uri(const uint8_t *data, size_t size)
{
	char *text = as_text(data, size < TEXT_MAX ? size : TEXT_MAX), host[64];
	tactus_uri uri;
	int port;
	if (tactus_uri_parse("fuzz", text, &uri) == 0) {
		if (tactus_uri_host(&uri, 502, host, sizeof(host), &port) == 0)
			FUZZ_HOLDS(port > 0 && port < 65536 && *host);
		for (size_t i = 0; i < uri.count; i++)
			FUZZ_HOLDS(tactus_uri_text(&uri, uri.options[i].key, NULL) == uri.options[i].value);
		FUZZ_HOLDS(tactus_uri_check(&uri) == 0);
		tactus_uri_clear(&uri);
	} else {
		FUZZ_HOLDS(*tactus_error_message());
	}
	free(text);
}

/* ---- references ---- */

static void read_ati(const uint8_t *data, size_t size)
{
	tactus_ati_record record;
	tactus_ati_scale scale;
	FUZZ_HOLDS(tactus_ati_parse(data, size, &record) == (size == TACTUS_ATI_RECORD));
	char *xml = as_text(data, size);
	if (tactus_ati_read_scale(xml, &scale) == 0)
		FUZZ_HOLDS(scale.counts_per_N > 0 && scale.counts_per_Nm > 0);
	free(xml);
}

/* Frames that come out when the bytes are put in so many at once, summed up. */
static uint64_t read_frames(const uint8_t *data, size_t size, size_t at_once)
{
	tactus_robotiq_stream stream = {.length = 0};
	double wrench[6];
	uint64_t frames = 0;
	for (size_t i = 0; i < size;) {
		size_t room;
		uint8_t *to = tactus_robotiq_room(&stream, &room);
		FUZZ_HOLDS(room > 0); /* or it would never go on */
		size_t n = at_once < room ? at_once : room;
		n = n < size - i ? n : size - i;
		memcpy(to, data + i, n);
		stream.length += n;
		i += n;
		while (tactus_robotiq_next(&stream, wrench)) {
			for (int k = 0; k < 6; k++)
				FUZZ_HOLDS(fabs(wrench[k]) <= (k < 3 ? 327.68 : 32.768));
			frames++;
		}
	}
	return frames * 1000003 + stream.corrupted;
}

static void read_robotiq(const uint8_t *data, size_t size)
{
	FUZZ_HOLDS(read_frames(data, size, 1) == read_frames(data, size, 64));
	FUZZ_HOLDS(read_frames(data, size, 7) == read_frames(data, size, 64));
}

/* ---- HID: a descriptor, then a report of sixteen bytes ---- */

static void read_hid(const uint8_t *data, size_t size)
{
	enum { REPORT = 16 };
	static const uint32_t usages[] = {TACTUS_HID_USAGE(1, 0x30), TACTUS_HID_USAGE(1, 0x31),
									  TACTUS_HID_USAGE(0x8d, 0x40), TACTUS_HID_USAGE(0x0f, 0x70)};
	if (size < REPORT)
		return;
	const uint8_t *report = data + size - REPORT;
	for (size_t i = 0; i < sizeof(usages) / sizeof(*usages); i++)
		for (int kind = TACTUS_HID_INPUT; kind <= TACTUS_HID_FEATURE; kind++) {
			tactus_hid_field field;
			int32_t value = 0, again = 0;
			uint8_t copy[REPORT];
			const int found = tactus_hid_find(data, size - REPORT, (enum tactus_hid_kind)kind, usages[i], &field);
			FUZZ_HOLDS(found >= 0 || *tactus_error_message());
			if (found <= 0)
				continue;
			FUZZ_HOLDS(field.bits >= 1 && field.bits <= 32);
			FUZZ_HOLDS(tactus_hid_length(data, size - REPORT, (enum tactus_hid_kind)kind, field.report) > 0);
			memcpy(copy, report, REPORT);
			if (tactus_hid_get(&field, report, REPORT, &value) && tactus_hid_put(&field, copy, REPORT, value)) {
				FUZZ_HOLDS(tactus_hid_get(&field, copy, REPORT, &again) && again == value);
				FUZZ_HOLDS(memcmp(copy, report, REPORT) == 0);
			}
		}
}

static void read_scale(const uint8_t *data, size_t size)
{
	double force_N = NAN;
	unsigned quality = 0;
	if (tactus_scale_decode(data, size, &force_N, &quality) == 1)
		FUZZ_HOLDS(!isinf(force_N) && (!isnan(force_N) || quality != 0));
}

/* ---- Modbus: a request of twelve bytes, then what is taken for its answer ---- */

static void judge_modbus(const uint8_t *data, size_t size)
{
	enum { REQUEST = 12 };
	if (size < REQUEST)
		return;
	tactus_modbus_request request = {
		.serial = (data[0] & 1) != 0, .transaction = (uint16_t)(data[1] << 8 | data[2]), .unit = data[3], .length = 5};
	memcpy(request.pdu, data + 4, 5);
	uint8_t *frame = malloc(size - REQUEST + 1);
	if (frame == NULL)
		abort();
	memcpy(frame, data + REQUEST, size - REQUEST);
	const enum tactus_modbus_verdict verdict = tactus_modbus_judge(&request, frame, size - REQUEST);
	if (verdict == TACTUS_MODBUS_ANSWER && request.pdu[0] >= 1 && request.pdu[0] <= 4) { /* all that was asked for */
		const size_t n = (size_t)request.pdu[3] << 8 | request.pdu[4];
		FUZZ_HOLDS(size - REQUEST >= (request.pdu[0] <= 2 ? (n + 7) / 8 : 2 * n));
	}
	free(frame);
}

static void read_profile(const uint8_t *data, size_t size)
{
	char path[FUZZ_PATH_SIZE];
	tactus_profile *profile = NULL;
	const int fd = fuzz_file(data, size, path);
	if (tactus_profile_open(path, size % 2 == 0, &profile) == 0)
		tactus_profile_free(profile);
	else
		FUZZ_HOLDS(*tactus_error_message());
	close(fd);
}

/* ---- Measurement Computing: calibration, then codes ---- */

static void read_mcc(const uint8_t *data, size_t size)
{
	const tactus_mcc_product *product;
	tactus_mcc_scale scale;
	if (size < TACTUS_MCC_CALIBRATION_SIZE + 2)
		return;
	const unsigned code = tactus_mcc_u16(data + TACTUS_MCC_CALIBRATION_SIZE);
	for (size_t i = 0; (product = tactus_mcc_product_at(i)) != NULL; i++)
		if (tactus_mcc_calibrate(product, 0, data, &scale))
			for (unsigned input = 0; input < TACTUS_MCC_INPUTS; input++)
				FUZZ_HOLDS(isfinite(tactus_mcc_volts(&scale, input, code)));
}

/* ---- LabJack: packets of a stream one after the other, as samples of slots of three lines and two inputs ---- */

static void read_labjack(const uint8_t *data, size_t size)
{
	labjack_slots slots = {.count = 6,
						   .levels = {0x101, 0x102, 0x104, 1, 2, 4},
						   .mask = 0x107,
						   .banks = {0, 1},
						   .bank_count = 2,
						   .input_count = 2};
	labjack_packet packet;
	long length;
	for (size_t at = 0; at < size && (length = labjack_packet_parse(data + at, size - at, &packet)) > 0;
		 at += (size_t)length) {
		FUZZ_HOLDS(length >= LABJACK_PACKET_HEADER && length <= LABJACK_PACKET_MAX && (size_t)length <= size - at);
		for (size_t i = 0; i < packet.samples; i++) {
			const uint64_t before = slots.number;
			const long slot = labjack_slots_put(&slots, labjack_packet_sample(data + at, i), &packet);
			FUZZ_HOLDS(slot >= -1 && slot < 6 && slots.number >= before);
			const unsigned lines = (slots.samples[0] & 0xffU) | (slots.samples[1] & 0xffU) << 8;
			if (slot >= 0) /* it is what its lines say, whatever was lost before */
				FUZZ_HOLDS((lines & 0x107) == slots.levels[slot]);
		}
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static void (*const parsers[])(const uint8_t *data,
								   size_t size) = {read_lines, read_uri,     read_ati,     read_robotiq, read_hid,
												   read_scale, judge_modbus, read_profile, read_mcc,     read_labjack};
	if (size > 0)
		parsers[data[0] % (sizeof(parsers) / sizeof(*parsers))](data + 1, size - 1);
	return 0;
}
