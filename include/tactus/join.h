/* Joining: a reference that was logged by another instrument, with a clock of its own, beside a scan. */
#ifndef TACTUS_JOIN_H
#define TACTUS_JOIN_H

#include <stdbool.h>
#include <stddef.h>

#include <tactus/export.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
	const char *force;   /**< the reference's column, added to the scan by this name; NULL: "force_N" */
	const char *reading; /**< the scan's column that follows the force; NULL: told by the columns */
	double offset_s;     /**< stated offset; NaN: estimated */
	double max_offset_s; /**< largest offset, of either sign, that is tried; NaN: any that leaves an overlap */
	bool drift;          /**< estimate also how much faster one clock runs */
} tactus_join_options;

/** What the two clocks have to do with each other: t_reference = t_scan - offset + drift (t_scan - t_scan,first). */
typedef struct {
	double offset_s;       /**< what is added to the reference's time to get the scan's, at the scan's start */
	double offset_std_s;   /**< its standard error; NaN where the offset was stated */
	double drift;          /**< 0 unless asked for */
	double drift_std;      /**< NaN unless asked for */
	double rival_offset_s; /**< another offset that fits nearly as well (a periodic load); NaN: none */
	double correlation;    /**< of the reading that follows the reference best; NaN where the offset was stated */
	size_t matched;        /**< rows that got a force */
} tactus_join_result;

/** The defaults: everything estimated but the drift. */
TACTUS_API tactus_join_options tactus_join_defaults(void);

/**
 * Puts the reference's force beside every row of a scan (whole tables), linearly interpolated in time; missing outside
 * the overlap and in gaps of the reference. The offset is the one at which the readings, channel by channel and mode
 * by mode, are best explained as a straight line over the force: first all lags of a common grid by normalised
 * cross-correlation, then Gauss-Newton on the rows themselves. The standard error allows for residuals that hang
 * together. A delay of the sensor's own (lag, creep) is part of the offset: two streams cannot tell it from the
 * clocks'. Where most of the noise is the reference's, which interpolation smooths unevenly, the standard error may be
 * a third too small. The offset is written to the scan's metadata (`reference_offset_s`, `reference_offset_std_s`,
 * `reference_drift`). options may be NULL. TACTUS_ERR_INPUT if a column is missing or a clock goes back;
 * TACTUS_ERR_DATA if the force never changes, no reading follows it, or there is no overlap.
 */
TACTUS_API int tactus_join(tactus_table *scan, const tactus_table *reference, const tactus_join_options *options,
						   tactus_join_result *result);

#ifdef __cplusplus
}
#endif

#endif
