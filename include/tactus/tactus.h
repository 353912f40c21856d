/*
 * tactus: trustworthy readings from low-cost piezoresistive force sensors.
 *
 * Conventions. Functions are tactus_<object>_<verb>. Handles are opaque; who frees what is said at each call. SI units
 * stand in every name that holds a quantity. Functions that can fail return 0 or a positive count, or a negative
 * enum tactus_error, and leave the detail in tactus_error_message().
 *
 * Threads. The library has no global state but the per-thread error message. Different handles may be used from
 * different threads at once; one handle by one thread at a time. It never prints, never exits, installs no signal
 * handler.
 */
#ifndef TACTUS_TACTUS_H
#define TACTUS_TACTUS_H

#include <tactus/device.h>
#include <tactus/diagnose.h>
#include <tactus/drive.h>
#include <tactus/emulate.h>
#include <tactus/error.h>
#include <tactus/fit.h>
#include <tactus/join.h>
#include <tactus/model.h>
#include <tactus/readout.h>
#include <tactus/table.h>
#include <tactus/version.h>

#endif
