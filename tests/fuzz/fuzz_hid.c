/* Any bytes as a HID report descriptor, then as a report: what is found lies inside its report and reads back. */
#include <math.h>
#include <string.h>

#include "device/hid_report.h"
#include "device/scale.h"
#include "fuzz.h"

static const uint32_t usages[] = {TACTUS_HID_USAGE(0x01, 0x30), TACTUS_HID_USAGE(0x01, 0x31), TACTUS_HID_USAGE(0x09, 3),
								  TACTUS_HID_USAGE(0x0F, 0x56), TACTUS_HID_USAGE(0x8D, 0x40)};

/* The value in these bytes goes in again and comes out the same; what is shorter is refused. */
static void use(const tactus_hid_field *field, int length, const uint8_t *data, size_t size)
{
	uint8_t report[TACTUS_HID_REPORT_MAX + 1] = {0};
	int32_t value, again;
	FUZZ_HOLDS(field->bits >= 1 && field->bits <= 32 && length > 0 && length <= TACTUS_HID_REPORT_MAX + 1);
	FUZZ_HOLDS((field->bit + field->bits + 7) / 8 + (field->report != 0) <= (unsigned)length);
	memcpy(report, data, size < sizeof(report) ? size : sizeof(report));
	report[0] = field->report != 0 ? field->report : report[0];
	FUZZ_HOLDS(tactus_hid_get(field, report, (size_t)length, &value));
	if (tactus_hid_put(field, report, (size_t)length, value))
		FUZZ_HOLDS(tactus_hid_get(field, report, (size_t)length, &again) && again == value);
	(void)tactus_hid_get(field, data, size, &value);
}

static void weigh(const uint8_t *data, size_t size)
{
	double force_N = NAN;
	unsigned quality = 0;
	if (tactus_scale_decode(data, size, &force_N, &quality) == 1) {
		FUZZ_HOLDS(isnan(force_N) || fabs(force_N) < 1e22);
		FUZZ_HOLDS(!isnan(force_N) || (quality & (TACTUS_QUALITY_MISSING | TACTUS_QUALITY_CLIPPED)) != 0);
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	for (int kind = TACTUS_HID_INPUT; kind <= TACTUS_HID_FEATURE; kind++)
		for (size_t i = 0; i < sizeof(usages) / sizeof(usages[0]); i++) {
			tactus_hid_field field;
			const int found = tactus_hid_find(data, size, (enum tactus_hid_kind)kind, usages[i], &field);
			const uint8_t report = found == 1 ? field.report : 0;
			const int length = tactus_hid_length(data, size, (enum tactus_hid_kind)kind, report);
			FUZZ_HOLDS((found < 0) == (length < 0));
			FUZZ_HOLDS(found >= 0 || *tactus_error_message() != '\0');
			if (found == 1)
				use(&field, length, data, size);
		}
	weigh(data, size);
	return 0;
}
