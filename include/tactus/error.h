/* Errors: one negative code per kind of fault, and a per-thread message that says where and what to do. */
#ifndef TACTUS_ERROR_H
#define TACTUS_ERROR_H

#include <tactus/export.h>

#ifdef __cplusplus
extern "C" {
#endif

/**
 * Every function that can fail returns 0 or a positive count on success and one of these on failure. The numbers
 * never change. On failure out-parameters are untouched, and tactus_error_message() has the detail.
 */
enum tactus_error {
	TACTUS_OK = 0,
	TACTUS_ERR_ARGUMENT = -1,     /**< an option or argument is unknown or out of range */
	TACTUS_ERR_MEMORY = -2,       /**< memory ran out */
	TACTUS_ERR_INPUT = -3,        /**< a file or stream cannot be read or does not parse */
	TACTUS_ERR_OUTPUT = -4,       /**< output could not be written */
	TACTUS_ERR_CLOSED = -5,       /**< the reader of our output closed the pipe */
	TACTUS_ERR_DATA = -6,         /**< the data do not support what was asked (too few, constant, missing) */
	TACTUS_ERR_CONVERGENCE = -7,  /**< a fit or a root did not converge */
	TACTUS_ERR_RANGE = -8,        /**< a quantity is outside the range in which the equation holds */
	TACTUS_ERR_DEVICE = -9,       /**< the device was not found or does not answer as it should */
	TACTUS_ERR_PERMISSION = -10,  /**< the device is there but may not be opened */
	TACTUS_ERR_LOST = -11,        /**< the device was lost, or too many scans were */
	TACTUS_ERR_UNSUPPORTED = -12, /**< this object cannot do that (simulate an estimator, say) */
	TACTUS_ERR_INTERRUPTED = -13  /**< the caller asked to stop */
};

/** The code's name, e.g. "TACTUS_ERR_INPUT"; "TACTUS_ERR_UNKNOWN" for any other number. Static. */
TACTUS_API const char *tactus_error_name(int code);

/** One line of text for the code. Static, never NULL. */
TACTUS_API const char *tactus_error_text(int code);

/**
 * The detail of the last failure in this thread ("run.csv:12: 'abc' is not a number"), "" if there was none. Owned
 * by the library, valid until the next failing call in the same thread.
 */
TACTUS_API const char *tactus_error_message(void);

#ifdef __cplusplus
}
#endif

#endif
