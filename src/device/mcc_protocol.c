/* The bytes of Measurement Computing's USB-1608FS-Plus and USB-201/202/204/205. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "device/mcc_protocol.h"

bool tactus_mcc_allowed(unsigned request, bool into)
{
	switch (request) {
	case TACTUS_MCC_TRISTATE:
	case TACTUS_MCC_LATCH:
	case TACTUS_MCC_RANGES:
	case TACTUS_MCC_STATUS: /* writing it clears the overrun */
		return true;
	case TACTUS_MCC_AIN:
	case TACTUS_MCC_CALIBRATION: /* writing would overwrite the factory's */
	case TACTUS_MCC_SERIAL:
		return into;
	case TACTUS_MCC_SCAN_START:
	case TACTUS_MCC_SCAN_STOP:
	case TACTUS_MCC_CLEAR_FIFO:
	case TACTUS_MCC_AOUT:
		return !into;
	default:
		return false;
	}
}

/* ---- products ---- */

#define USB_20X .bits = 12, .simultaneous = false, .has_ranges = false, .clock_Hz = 70e6

static const tactus_mcc_product products[] = {
	{.product = 0x00ea,
	 .name = "USB-1608FS-Plus",
	 .profile = "mcc-usb-1608fs-plus",
	 .bits = 16,
	 .simultaneous = true,
	 .has_ranges = true,
	 .clock_Hz = 40e6,
	 .input_rate_Hz = 100e3,
	 .total_rate_Hz = 400e3},
	{.product = 0x0113,
	 .name = "USB-201",
	 .profile = "mcc-usb-201",
	 .input_rate_Hz = 100e3,
	 .total_rate_Hz = 100e3,
	 USB_20X},
	{.product = 0x012b,
	 .name = "USB-202",
	 .profile = "mcc-usb-202",
	 .input_rate_Hz = 100e3,
	 .total_rate_Hz = 100e3,
	 .outputs = 2,
	 USB_20X},
	{.product = 0x0114,
	 .name = "USB-204",
	 .profile = "mcc-usb-201",
	 .input_rate_Hz = 500e3,
	 .total_rate_Hz = 500e3,
	 USB_20X},
	{.product = 0x012c,
	 .name = "USB-205",
	 .profile = "mcc-usb-202",
	 .input_rate_Hz = 500e3,
	 .total_rate_Hz = 500e3,
	 .outputs = 2,
	 USB_20X},
};

const tactus_mcc_product *tactus_mcc_product_at(size_t i)
{
	return i < TACTUS_COUNT(products) ? &products[i] : NULL;
}

const tactus_mcc_product *tactus_mcc_find_product(unsigned product)
{
	for (size_t i = 0; i < TACTUS_COUNT(products); i++)
		if (products[i].product == product)
			return &products[i];
	return NULL;
}

/* ---- codes and volts ---- */

static const struct {
	unsigned code;
	double full_scale_V;
} ranges[] = {{5, 1}, {3, 2}, {1, 5}, {0, 10}};

bool tactus_mcc_range(const tactus_mcc_product *product, double volts, unsigned *code, double *full_scale_V)
{
	const size_t widest = TACTUS_COUNT(ranges) - 1;
	size_t i = volts > 0 && product->has_ranges ? 0 : widest;
	while (i < widest && ranges[i].full_scale_V < volts)
		i++;
	*code = ranges[i].code;
	*full_scale_V = ranges[i].full_scale_V;
	return volts <= ranges[i].full_scale_V;
}

static double float_at(const uint8_t *bytes)
{
	const uint32_t bits = bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
	float value;
	memcpy(&value, &bits, sizeof(value));
	return (double)value;
}

unsigned tactus_mcc_calibration_address(unsigned range)
{
	return range * TACTUS_MCC_CALIBRATION_SIZE;
}

bool tactus_mcc_calibrate(const tactus_mcc_product *product, unsigned range,
						  const uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE], tactus_mcc_scale *scale)
{
	const double middle = exp2(product->bits - 1);
	tactus_mcc_scale made = {.top = (1u << product->bits) - 1};
	for (size_t i = 0; i < TACTUS_COUNT(ranges); i++)
		if (ranges[i].code == range)
			made.full_scale_V = ranges[i].full_scale_V;
	for (size_t i = 0; i < TACTUS_MCC_INPUTS; i++) {
		const double slope = float_at(bytes + 8 * i), offset = float_at(bytes + 8 * i + 4);
		/* Real ones are within a percent; an erased memory is NaN, a blank one 0. */
		if (!(slope > 0.5 && slope < 2 && fabs(offset) < 0.25 * middle))
			return false;
		made.gain_V[i] = slope * made.full_scale_V / middle;
		made.offset_V[i] = (offset - middle) * made.full_scale_V / middle;
	}
	*scale = made;
	return true;
}

double tactus_mcc_volts(const tactus_mcc_scale *scale, unsigned input, unsigned code)
{
	return scale->gain_V[input] * code + scale->offset_V[input];
}

bool tactus_mcc_clipped(const tactus_mcc_scale *scale, unsigned code)
{
	return code == 0 || code >= scale->top;
}

unsigned tactus_mcc_output_code(double volts)
{
	const double code = round(volts * (TACTUS_MCC_OUTPUT_TOP + 1) / TACTUS_MCC_OUTPUT_FULL_SCALE_V);
	return (unsigned)fmin(fmax(code, 0), TACTUS_MCC_OUTPUT_TOP);
}

/* ---- scans ---- */

/* Ticks of the pacer per tick of the scan: a converter that takes inputs in turn is paced for each of them. */
static double turns(const tactus_mcc_product *product, unsigned mask)
{
	return product->simultaneous ? 1 : __builtin_popcount(mask);
}

int tactus_mcc_plan_scan(const tactus_mcc_product *product, double rate_Hz, unsigned mask, uint32_t count,
						 tactus_mcc_scan *scan)
{
	const int inputs = __builtin_popcount(mask);
	const double most_Hz = fmin(product->input_rate_Hz, product->total_rate_Hz / fmax(inputs, 1));
	const double least_Hz = product->clock_Hz / UINT32_MAX;
	if (inputs == 0 || mask >= 1u << TACTUS_MCC_INPUTS)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a scan needs one to eight inputs");
	if (!(rate_Hz >= least_Hz && rate_Hz <= most_Hz * (1 + 1e-9)))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%g samples a second of %d input%s: the %s takes %.3g to %.6g", rate_Hz,
						   inputs, inputs > 1 ? "s" : "", product->name, least_Hz, most_Hz);
	const double ticks = fmax(2, round(product->clock_Hz / (rate_Hz * turns(product, mask))));
	*scan = (tactus_mcc_scan){
		.count = count,
		.period = (uint32_t)(ticks - 1),
		.mask = (uint8_t)mask,
		.rate_Hz = product->clock_Hz / (ticks * turns(product, mask)),
	};
	return TACTUS_OK;
}

static void put_u32(uint8_t *to, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		to[i] = (uint8_t)(value >> 8 * i);
}

/* No options: whole packets, no trigger, and a full buffer stalls the endpoint, so that a loss has its place. */
size_t tactus_mcc_scan_record(const tactus_mcc_product *product, const tactus_mcc_scan *scan,
							  uint8_t record[TACTUS_MCC_SCAN_RECORD_MAX])
{
	memset(record, 0, TACTUS_MCC_SCAN_RECORD_MAX);
	put_u32(record, scan->count);
	put_u32(record + 4, scan->period);
	record[8] = scan->mask;
	return product->simultaneous ? 10 : 12;
}

double tactus_mcc_skew_s(const tactus_mcc_product *product, const tactus_mcc_scan *scan, unsigned i)
{
	return product->simultaneous ? 0 : i * ((double)scan->period + 1) / product->clock_Hz;
}
