/* What comes from a LabJack's stream, without any link. */
#include "device/labjack_packet.h"

static uint16_t word(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

long labjack_packet_parse(const uint8_t *bytes, size_t n, labjack_packet *packet)
{
	enum { MBAP = 6 }; /* bytes before those that its length counts */
	if (n < LABJACK_PACKET_HEADER)
		return 0;
	const size_t length = MBAP + (size_t)word(bytes + 4);
	if (word(bytes + 2) != 0 || bytes[7] != LABJACK_PACKET_FUNCTION || bytes[8] != LABJACK_PACKET_TYPE ||
		length < LABJACK_PACKET_HEADER || length > LABJACK_PACKET_MAX || length % 2 != 0)
		return -1;
	if (n < length)
		return 0;
	*packet = (labjack_packet){
		.transaction = word(bytes),
		.backlog = word(bytes + 10),
		.status = word(bytes + 12),
		.information = word(bytes + 14),
		.samples = (length - LABJACK_PACKET_HEADER) / 2,
	};
	return (long)length;
}

uint16_t labjack_packet_sample(const uint8_t *bytes, size_t i)
{
	return word(bytes + LABJACK_PACKET_HEADER + 2 * i);
}

double labjack_t7_volts(const float calibration[LABJACK_T7_FLOATS], int range, uint16_t code)
{
	/* four sets of positive slope, negative slope, centre, offset */
	const float *c = calibration + (ptrdiff_t)4 * range;
	const double from_center = (double)code - (double)c[2];
	return from_center < 0 ? -from_center * (double)c[1] : from_center * (double)c[0];
}

double labjack_t4_volts(const float calibration[LABJACK_T7_FLOATS], int input, uint16_t code)
{
	/* slope and offset of each ±10 V input, then of all others */
	const float *c = calibration + (ptrdiff_t)2 * (input < LABJACK_T4_HIGH_INPUTS ? input : LABJACK_T4_HIGH_INPUTS);
	return (double)code * (double)c[0] + (double)c[1];
}

/* Nothing but dummies: scans are missing here. */
static bool is_dummy(const labjack_slots *s)
{
	for (size_t i = 0; i < s->bank_count + s->input_count; i++)
		if (s->samples[i] != LABJACK_DUMMY)
			return false;
	return true;
}

static uint32_t lines(const labjack_slots *s)
{
	uint32_t levels = 0;
	for (size_t i = 0; i < s->bank_count; i++)
		levels |= (uint32_t)(s->samples[i] & 0xff) << 8 * s->banks[i];
	return levels & s->mask;
}

long labjack_slots_put(labjack_slots *s, uint16_t sample, const labjack_packet *packet)
{
	s->samples[s->held++] = sample;
	if (s->held < s->bank_count + s->input_count)
		return -1;
	s->held = 0;
	if (is_dummy(s)) {
		const uint64_t skipped =
			packet->status == LABJACK_RECOVERY_ENDED && packet->information > 0 ? packet->information : 1;
		s->number += skipped;
		s->skipped += skipped;
		return -1;
	}
	const uint64_t number = s->number++;
	size_t expected = (size_t)((number + s->phase) % s->count), found = 0;
	const uint32_t levels = lines(s);
	if (levels == s->levels[expected])
		return (long)expected;
	s->misplaced++;
	while (found < s->count && s->levels[found] != levels)
		found++;
	if (found == s->count)
		return -1;
	s->phase = (s->phase + s->count + found - expected) % s->count;
	return (long)found;
}
