/*
 * A reference beside a scan. Its thread reads it and keeps the last samples with their instants on the monotonic clock;
 * a reading of the scan is held until there is a sample after it, and gets the force by linear interpolation.
 */
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/reference.h"

enum { SAMPLES = 8192, FIRST_SAMPLES = 16, BATCH = 256, GAP = 10 }; /* GAP intervals without a sample are a gap */

#define PATIENCE_S 0.25    /* a reading waits for the sample after it at least so long */
#define PATIENCE_SAMPLES 3 /* and at least so many intervals */
#define FIRST_PATIENCE_S 5 /* for a first sample */

typedef struct {
	int64_t at_ns;
	double force_N;
	unsigned quality;
} sample;

struct tactus_reference {
	tactus_device *device; /* read by the thread alone while it runs */
	pthread_t thread;
	bool running;
	atomic_bool stop;
	double reconnect_s;
	/* under the mutex: */
	pthread_mutex_t mutex;
	pthread_cond_t more;
	sample samples[SAMPLES]; /* the last ones, sample i in [i % SAMPLES] */
	uint64_t count;
	tactus_timing intervals;
	int error;
	char message[512];
	tactus_faults faults;
	/* the scan's: */
	tactus_reading *pending;
	size_t held, capacity;
	bool over; /* the scan has no more readings to give */
};

/* ---- the thread ---- */

static void keep(struct tactus_reference *r, const tactus_reading *readings, size_t n)
{
	pthread_mutex_lock(&r->mutex);
	for (size_t i = 0; i < n; i++) {
		if (isnan(readings[i].force_N))
			continue;
		const int64_t at_ns = r->device->live.origin_ns + (int64_t)llround(1e9 * readings[i].time_s);
		if (r->count > 0) {
			const int64_t before_ns = r->samples[(r->count - 1) % SAMPLES].at_ns;
			if (at_ns <= before_ns)
				continue;
			tactus_timing_add(&r->intervals, 1e-9 * (double)(at_ns - before_ns));
		}
		r->samples[r->count++ % SAMPLES] = (sample){at_ns, readings[i].force_N, readings[i].quality};
	}
	r->faults = r->device->faults;
	pthread_cond_broadcast(&r->more);
	pthread_mutex_unlock(&r->mutex);
}

static void give_up(struct tactus_reference *r, int code)
{
	pthread_mutex_lock(&r->mutex);
	r->error = code;
	snprintf(r->message, sizeof(r->message), "reference: %s", tactus_error_message());
	pthread_cond_broadcast(&r->more);
	pthread_mutex_unlock(&r->mutex);
}

static void *run(void *context)
{
	struct tactus_reference *r = context;
	tactus_reading readings[BATCH];
	while (!r->stop) {
		long n = tactus_device_read(r->device, readings, BATCH);
		if (n == TACTUS_ERR_LOST)
			n = tactus_device_recover(r->device, r->reconnect_s);
		else if (n == 0)
			n = tactus_fail(TACTUS_ERR_LOST, "no more samples");
		else if (n > 0)
			keep(r, readings, (size_t)n);
		if (n < 0 && n != TACTUS_ERR_INTERRUPTED) {
			give_up(r, (int)n);
			break;
		}
	}
	return NULL;
}

/* ---- from new to free ---- */

struct tactus_reference *tactus_reference_new(tactus_device *device)
{
	struct tactus_reference *r = calloc(1, sizeof(*r));
	pthread_condattr_t attributes;
	if (r == NULL)
		return NULL;
	r->device = device;
	pthread_mutex_init(&r->mutex, NULL);
	pthread_condattr_init(&attributes);
	pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
	pthread_cond_init(&r->more, &attributes);
	pthread_condattr_destroy(&attributes);
	return r;
}

void tactus_reference_stop(struct tactus_reference *r)
{
	if (!r->running)
		return;
	r->stop = true;
	r->device->cancelled = true;
	pthread_join(r->thread, NULL);
	r->running = false;
	tactus_device_stop(r->device);
}

void tactus_reference_free(struct tactus_reference *r)
{
	if (r == NULL)
		return;
	tactus_reference_stop(r);
	tactus_device_close(r->device);
	pthread_cond_destroy(&r->more);
	pthread_mutex_destroy(&r->mutex);
	free(r->pending);
	free(r);
}

/* Waits for a change until that instant; with the mutex held. */
static void wait_until(struct tactus_reference *r, int64_t until_ns)
{
	const struct timespec until = {.tv_sec = (time_t)(until_ns / 1000000000), .tv_nsec = (long)(until_ns % 1000000000)};
	pthread_cond_timedwait(&r->more, &r->mutex, &until);
}

static int start_thread(struct tactus_reference *r)
{
	/* signals are the caller's business */
	sigset_t all, before;
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	const int failed = pthread_create(&r->thread, NULL, run, r);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	r->running = failed == 0;
	return failed != 0 ? tactus_fail(TACTUS_ERR_MEMORY, "no thread for the reference: %s", strerror(failed))
					   : TACTUS_OK;
}

static int wait_first(struct tactus_reference *r)
{
	const int64_t until_ns = tactus_clock_ahead_ns(FIRST_PATIENCE_S);
	pthread_mutex_lock(&r->mutex);
	while (r->count < FIRST_SAMPLES && r->error >= 0 && tactus_clock_ns() < until_ns)
		wait_until(r, until_ns);
	const uint64_t count = r->count;
	pthread_mutex_unlock(&r->mutex);
	const int code = count >= FIRST_SAMPLES ? TACTUS_OK : tactus_reference_error(r);
	if (code >= 0 && count == 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "reference: no sample came within %d s", FIRST_PATIENCE_S);
	return code;
}

int tactus_reference_start(struct tactus_reference *r, const tactus_scan_settings *settings)
{
	tactus_scan_settings own = tactus_scan_defaults();
	own.timeout_s = settings->timeout_s;
	tactus_reference_stop(r);
	r->stop = r->over = false;
	r->device->cancelled = false;
	r->count = r->held = 0;
	r->error = TACTUS_OK;
	r->intervals = (tactus_timing){0};
	r->reconnect_s = settings->reconnect_s;
	int code = tactus_device_start(r->device, &own);
	if (code >= 0 && !r->device->has_force)
		code = tactus_fail(TACTUS_ERR_ARGUMENT, "it gives no force_N");
	if (code < 0)
		return tactus_fail_prefix(code, "reference: ");
	code = start_thread(r);
	return code < 0 ? code : wait_first(r);
}

int tactus_reference_say(struct tactus_reference *r, tactus_metadata *metadata)
{
	const char *identity = tactus_metadata_get(r->device->metadata, "device");
	const bool asked = r->device->timing.n > 0; /* else it sends on its own */
	pthread_mutex_lock(&r->mutex);
	const tactus_timing intervals = r->intervals;
	pthread_mutex_unlock(&r->mutex);
	int code = tactus_metadata_set(metadata, "reference_device", identity);
	if (code >= 0)
		code = tactus_metadata_set_number(metadata, "reference_rate_Hz", intervals.n > 0 ? 1 / intervals.mean_s : NAN);
	if (code >= 0)
		code = tactus_metadata_set_number(metadata, "reference_delay_s", asked ? r->device->timing.mean_s / 2 : NAN);
	if (code >= 0)
		code = tactus_metadata_set_number(metadata, "reference_jitter_s",
										  tactus_timing_std_s(asked ? &r->device->timing : &intervals));
	return code;
}

int tactus_reference_error(struct tactus_reference *r)
{
	pthread_mutex_lock(&r->mutex);
	const int code = r->error < 0 ? tactus_fail(r->error, "%s", r->message) : TACTUS_OK;
	pthread_mutex_unlock(&r->mutex);
	return code;
}

void tactus_reference_add_faults(struct tactus_reference *r, tactus_faults *sum)
{
	pthread_mutex_lock(&r->mutex);
	sum->timeouts += r->faults.timeouts;
	sum->corrupted += r->faults.corrupted;
	sum->exceptions += r->faults.exceptions;
	sum->mismatched += r->faults.mismatched;
	sum->overruns += r->faults.overruns;
	sum->reconnections += r->faults.reconnections;
	pthread_mutex_unlock(&r->mutex);
}

/* ---- the force beside readings ---- */

/*
 * Linear between the samples around the instant; NaN before the first, after the last and in a gap. What is wrong with
 * either sample (a scale in motion, an overload) is added to *quality.
 */
static double force_at(const struct tactus_reference *r, int64_t at_ns, unsigned *quality)
{
	const uint64_t oldest = r->count > SAMPLES ? r->count - SAMPLES : 0;
	uint64_t i = r->count; /* of the first sample after the instant; readings are young: from the end */
	while (i > oldest && r->samples[(i - 1) % SAMPLES].at_ns > at_ns)
		i--;
	if (i == oldest)
		return NAN;
	const sample *a = &r->samples[(i - 1) % SAMPLES], *b = &r->samples[i % SAMPLES];
	if (a->at_ns == at_ns)
		b = a;
	else if (i == r->count || 1e-9 * (double)(b->at_ns - a->at_ns) > GAP * r->intervals.mean_s)
		return NAN;
	*quality |= a->quality | b->quality;
	const double share = a == b ? 0 : (double)(at_ns - a->at_ns) / (double)(b->at_ns - a->at_ns);
	return a->force_N + (b->force_N - a->force_N) * share;
}

static int64_t instant_ns(const tactus_device *device, const tactus_reading *reading)
{
	return device->live.origin_ns + (int64_t)llround(1e9 * reading->time_s);
}

/* How many of the pending readings need not wait: whole scans whose force is known, or waited for long enough. */
static size_t ready(const struct tactus_reference *r, const tactus_device *device)
{
	const double patience_s = fmax(PATIENCE_S, PATIENCE_SAMPLES * r->intervals.mean_s);
	const int64_t late_ns = tactus_clock_ns() - (int64_t)(1e9 * patience_s);
	const int64_t known_ns = r->count > 0 ? r->samples[(r->count - 1) % SAMPLES].at_ns : 0;
	const int64_t until_ns = known_ns > late_ns ? known_ns : late_ns;
	size_t n = 0;
	while (n < r->held && instant_ns(device, &r->pending[n]) <= until_ns)
		n++;
	while (n > 0 && n < r->held && r->pending[n].sequence == r->pending[n - 1].sequence)
		n--;
	return n;
}

static size_t deliver(struct tactus_reference *r, const tactus_device *device, size_t n, tactus_reading *readings)
{
	for (size_t i = 0; i < n; i++) {
		readings[i] = r->pending[i];
		readings[i].force_N = force_at(r, instant_ns(device, &readings[i]), &readings[i].quality);
		if (isnan(readings[i].force_N))
			readings[i].quality |= TACTUS_QUALITY_MISSING;
	}
	r->held -= n;
	if (n > 0) /* nothing is pending before the first reading */
		memmove(r->pending, r->pending + n, r->held * sizeof(*r->pending));
	return n;
}

static size_t take_ready(struct tactus_reference *r, const tactus_device *device, tactus_reading *readings, size_t max)
{
	pthread_mutex_lock(&r->mutex);
	size_t n = ready(r, device);
	while (r->over && n == 0 && r->held > 0 && r->error >= 0) { /* nothing else to do than to wait for it */
		wait_until(r, tactus_clock_ahead_ns(PATIENCE_S));
		n = ready(r, device);
	}
	if (r->over && r->error < 0)
		n = r->held;
	n = deliver(r, device, n < max ? n : max, readings);
	pthread_mutex_unlock(&r->mutex);
	return n;
}

static int make_room(struct tactus_reference *r)
{
	if (r->capacity - r->held >= BATCH)
		return TACTUS_OK;
	const size_t capacity = 2 * r->capacity + BATCH;
	tactus_reading *grown = realloc(r->pending, capacity * sizeof(*grown));
	if (grown == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	r->pending = grown;
	r->capacity = capacity;
	return TACTUS_OK;
}

long tactus_reference_read(struct tactus_reference *r, tactus_device *device, tactus_reading *readings, size_t max)
{
	for (;;) {
		const size_t n = take_ready(r, device, readings, max);
		if (n > 0 || r->over)
			return (long)n;
		int code = tactus_reference_error(r);
		if (code >= 0)
			code = make_room(r);
		if (code < 0)
			return code;
		const long got = device->backend->read(device, r->pending + r->held, r->capacity - r->held);
		if (got == TACTUS_ERR_INTERRUPTED && r->held > 0) { /* what came is kept */
			pthread_mutex_lock(&r->mutex);
			const size_t kept = deliver(r, device, r->held < max ? r->held : max, readings);
			pthread_mutex_unlock(&r->mutex);
			return (long)kept;
		}
		if (got < 0)
			return got;
		r->held += (size_t)got;
		r->over = got == 0;
	}
}
