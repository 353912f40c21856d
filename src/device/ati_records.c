/* ATI Net F/T: bytes and units. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <tactus/table.h>

#include "core/core.h"
#include "device/ati_records.h"

static uint32_t big_endian(const uint8_t *bytes)
{
	return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

void tactus_ati_request(enum tactus_ati_command command, uint32_t count, uint8_t bytes[TACTUS_ATI_REQUEST])
{
	const uint8_t request[TACTUS_ATI_REQUEST] = {
		0x12,          0x34, 0, (uint8_t)command, (uint8_t)(count >> 24), (uint8_t)(count >> 16), (uint8_t)(count >> 8),
		(uint8_t)count};
	memcpy(bytes, request, sizeof(request));
}

bool tactus_ati_parse(const uint8_t *bytes, size_t n, tactus_ati_record *record)
{
	if (n != TACTUS_ATI_RECORD)
		return false;
	record->sequence = big_endian(bytes);
	record->sample = big_endian(bytes + 4);
	record->status = big_endian(bytes + 8);
	for (size_t i = 0; i < TACTUS_COUNT(record->counts); i++)
		record->counts[i] = (int32_t)big_endian(bytes + 12 + 4 * i);
	return true;
}

/* ---- units ---- */

#define POUND_N 4.4482216152605 /* exact: 0.45359237 kg × 9.80665 m/s² */
#define INCH_M 0.0254
#define GRAVITY 9.80665

static const struct {
	const char *name;
	double value;
} force_units[] = {{"N", 1},    {"lbf", POUND_N}, {"lb", POUND_N},  {"klbf", 1e3 * POUND_N}, {"klb", 1e3 * POUND_N},
				   {"kN", 1e3}, {"kg", GRAVITY},  {"kgf", GRAVITY}, {"g", 1e-3 * GRAVITY}},
  torque_units[] = {{"Nm", 1},
					{"N-m", 1},
					{"Nmm", 1e-3},
					{"N-mm", 1e-3},
					{"kNm", 1e3},
					{"kN-m", 1e3},
					{"lbf-in", POUND_N *INCH_M},
					{"lb-in", POUND_N *INCH_M},
					{"lbf-ft", POUND_N * 12 * INCH_M},
					{"lb-ft", POUND_N * 12 * INCH_M},
					{"kgcm", GRAVITY * 1e-2},
					{"kg-cm", GRAVITY * 1e-2}};

/* The text of <tag>…</tag>, which is short and has no markup of its own; false if it is not there. */
static bool element(const char *xml, const char *tag, char *text, size_t size)
{
	char open[32];
	snprintf(open, sizeof(open), "<%s>", tag);
	const char *begin = strstr(xml, open);
	if (begin == NULL)
		return false;
	begin += strlen(open);
	const size_t length = strcspn(begin, "<");
	if (length >= size || begin[length] == '\0')
		return false;
	memcpy(text, begin, length);
	text[length] = '\0';
	return true;
}

static int read_counts(const char *xml, const char *tag, double *counts)
{
	char text[64];
	if (!element(xml, tag, text, sizeof(text)) || !tactus_parse_number(text, strlen(text), counts) || !(*counts > 0))
		return tactus_fail(TACTUS_ERR_DEVICE, "netftapi2.xml has no %s that is a number above zero", tag);
	return TACTUS_OK;
}

int tactus_ati_read_scale(const char *xml, tactus_ati_scale *scale)
{
	char force[32] = "", torque[32] = "";
	double force_counts = 0, torque_counts = 0, force_N = 0, torque_Nm = 0;
	int code = read_counts(xml, "cfgcpf", &force_counts);
	code = code < 0 ? code : read_counts(xml, "cfgcpt", &torque_counts);
	if (code < 0)
		return code;
	if (!element(xml, "scfgfu", force, sizeof(force)) || !element(xml, "scfgtu", torque, sizeof(torque)))
		return tactus_fail(TACTUS_ERR_DEVICE, "netftapi2.xml has no units (scfgfu, scfgtu)");
	for (size_t i = 0; i < TACTUS_COUNT(force_units); i++)
		if (strcasecmp(force_units[i].name, force) == 0)
			force_N = force_units[i].value;
	for (size_t i = 0; i < TACTUS_COUNT(torque_units); i++)
		if (strcasecmp(torque_units[i].name, torque) == 0)
			torque_Nm = torque_units[i].value;
	if (force_N == 0 || torque_Nm == 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "netftapi2.xml: unknown unit '%s'", force_N == 0 ? force : torque);
	*scale = (tactus_ati_scale){force_counts / force_N, torque_counts / torque_Nm};
	return TACTUS_OK;
}
