/* Joining inside: tracks of samples over time, and the search for the offset between two clocks. */
#ifndef TACTUS_CORE_JOIN_H
#define TACTUS_CORE_JOIN_H

#include <tactus/join.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Samples in time order, none missing. A scan has one track per channel and mode, a reference one. */
typedef struct {
	double *time_s, *value;
	size_t n;
	double step_s; /* median */
	int sign;      /* of the slope over the force: +1, -1, or 0 where either may be */
} tactus_track;

/* A step this many times the median is a gap: nothing is interpolated across it. */
enum { TACTUS_TRACK_GAP = 10 };

/* Linear interpolation; NaN outside and in gaps. *at remembers the place: cheap for times that rise. */
double tactus_track_value(const tactus_track *track, double time_s, size_t *at);

/* Finds the offset; fills all of result but `matched`. */
int tactus_align(const tactus_track *tracks, size_t n, const tactus_track *reference,
				 const tactus_join_options *options, tactus_join_result *result);

/* out[k + nb - 1] = Σ_j a[j + k] b[j] for k = -(nb - 1) … na - 1, through FFTs. TACTUS_ERR_MEMORY. */
int tactus_correlate(const double *a, size_t na, const double *b, size_t nb, double *out);

#ifdef __cplusplus
}
#endif

#endif
