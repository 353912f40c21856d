/* What the suites of mocked Measurement Computing devices share: benches, scans, tables of what was sent. */
#ifndef MOCK_USB_SCAN_H
#define MOCK_USB_SCAN_H

#include "mock_usb.h"

/* ---- benches ---- */

#define BENCH "kind = \"bench\"\nbase = \"paredes\"\n[scan]\nrate_Hz = 1\nsettle_s = 0\n"

static const char wave_1608[] = BENCH "modes = [\"ac\"]\nfrequency_Hz = 1000\n[wiring]\nswitch_lines = [0, 1, 2, 3, 4, "
									  "5, 6, 7]\nswitch_active = \"high\"\n"
									  "amplitude_input = 4\ndrive_input = 1\n";

/*
 * Opens a device on a bench of that text. Requests that are answered may take as long as they like on a machine that is
 * busy; where one is not, SOON is what the test waits for.
 */
#define SOON "&timeout=300ms"
static inline tactus_device *open_bench(const char *address, const char *bench, const char *options)
{
	char *path = rig_file(".toml", bench), uri[256];
	tactus_device *device = NULL;
	snprintf(uri, sizeof(uri), "usb:%s?profile=%s%s", address, path, options[0] != '\0' ? options : "&timeout=10s");
	const int code = tactus_device_open(uri, &device);
	rig_remove(path);
	if (code < 0)
		fail_msg("%s: %s", uri, tactus_error_message());
	return device;
}

static inline tactus_scan_settings counted(uint64_t count, const int *channels, size_t n)
{
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = count;
	settings.channels = channels;
	settings.channel_count = n;
	settings.rate_Hz = 2; /* a machine that is busy may be half a second late */
	return settings;
}

static inline void start(tactus_device *device, const tactus_scan_settings *settings)
{
	if (tactus_device_start(device, settings) < 0)
		fail_msg("%s", tactus_error_message());
}

static const int first[] = {1}, two[] = {1, 2};

/* ---- what was sent ---- */

/* Compares what was asked from `from` on. */
static inline void assert_sent(const mock_usb *usb, size_t from, const mock_exchange *expected, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		const mock_exchange *got = &usb->log[from + i], *want = &expected[i];
		if (from + i >= usb->logged || got->into != want->into || got->request != want->request ||
			got->value != want->value || got->index != want->index || got->length != want->length ||
			memcmp(got->data, want->data, sizeof(got->data)) != 0)
			fail_msg("exchange %zu: %s 0x%02x value %u index %u length %zu, not %s 0x%02x value %u index %u length %zu",
					 i, got->into ? "in" : "out", got->request, got->value, got->index, got->length,
					 want->into ? "in" : "out", want->request, want->value, want->index, want->length);
	}
	assert_int_equal(usb->logged - from, n);
}

#define IN true
#define OUT false
#define ALONE(request)                                                                                                 \
	{                                                                                                                  \
		OUT, request, 0, 0, 0,                                                                                         \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define SERIAL                                                                                                         \
	{                                                                                                                  \
		IN, 0x48, 0, 0, 8,                                                                                             \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define SCAN_ENDED ALONE(0x12), ALONE(MOCK_CLEAR_HALT), ALONE(0x15), ALONE(0x44)
#define CALIBRATION(address)                                                                                           \
	{                                                                                                                  \
		IN, 0x30, address, 0, 64,                                                                                      \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define LINES_READ                                                                                                     \
	{IN, 0x02, 0, 0, 1, {0}},                                                                                          \
	{                                                                                                                  \
		IN, 0x00, 0, 0, 1,                                                                                             \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define STATUS                                                                                                         \
	{                                                                                                                  \
		IN, 0x44, 0, 0, 2,                                                                                             \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define LATCH(value)                                                                                                   \
	{                                                                                                                  \
		OUT, 0x02, value, 0, 0,                                                                                        \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}
#define AIN(input, range)                                                                                              \
	{                                                                                                                  \
		IN, 0x10, input, range, 2,                                                                                     \
		{                                                                                                              \
			0                                                                                                          \
		}                                                                                                              \
	}

#endif
