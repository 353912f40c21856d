/* Error codes in words, and the per-thread message that says where and what to do. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/core.h"

enum { MESSAGE_SIZE = 1024 };
static _Thread_local char last_message[MESSAGE_SIZE];

static const struct {
	int code;
	const char *name, *text;
} errors[] = {
	{TACTUS_OK, "TACTUS_OK", "success"},
	{TACTUS_ERR_ARGUMENT, "TACTUS_ERR_ARGUMENT", "an option or argument is unknown or out of range"},
	{TACTUS_ERR_MEMORY, "TACTUS_ERR_MEMORY", "memory ran out"},
	{TACTUS_ERR_INPUT, "TACTUS_ERR_INPUT", "the input cannot be read or does not parse"},
	{TACTUS_ERR_OUTPUT, "TACTUS_ERR_OUTPUT", "the output could not be written"},
	{TACTUS_ERR_CLOSED, "TACTUS_ERR_CLOSED", "the reader of the output closed the pipe"},
	{TACTUS_ERR_DATA, "TACTUS_ERR_DATA", "the data do not support what was asked"},
	{TACTUS_ERR_CONVERGENCE, "TACTUS_ERR_CONVERGENCE", "the computation did not converge"},
	{TACTUS_ERR_RANGE, "TACTUS_ERR_RANGE", "a quantity is outside the range in which the equation holds"},
	{TACTUS_ERR_DEVICE, "TACTUS_ERR_DEVICE", "the device was not found or does not answer as it should"},
	{TACTUS_ERR_PERMISSION, "TACTUS_ERR_PERMISSION", "the device is there but may not be opened"},
	{TACTUS_ERR_LOST, "TACTUS_ERR_LOST", "the device was lost, or too many scans were"},
	{TACTUS_ERR_UNSUPPORTED, "TACTUS_ERR_UNSUPPORTED", "this object cannot do that"},
	{TACTUS_ERR_INTERRUPTED, "TACTUS_ERR_INTERRUPTED", "stopped on request"},
};

const char *tactus_error_name(int code)
{
	for (size_t i = 0; i < TACTUS_COUNT(errors); i++)
		if (errors[i].code == code)
			return errors[i].name;
	return "TACTUS_ERR_UNKNOWN";
}

const char *tactus_error_text(int code)
{
	for (size_t i = 0; i < TACTUS_COUNT(errors); i++)
		if (errors[i].code == code)
			return errors[i].text;
	return "unknown error";
}

const char *tactus_error_message(void)
{
	return last_message;
}

int(tactus_fail)(int code, const char *format, ...)
{
	char text[MESSAGE_SIZE]; /* the arguments may point into the present message */
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	memcpy(last_message, text, sizeof text);
	return code;
}

int(tactus_fail_prefix)(int code, const char *format, ...)
{
	char text[MESSAGE_SIZE];
	va_list arguments;
	va_start(arguments, format);
	int length = vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	if (length >= 0 && (size_t)length < sizeof text)
		snprintf(text + length, sizeof text - (size_t)length, "%s", last_message);
	memcpy(last_message, text, sizeof text);
	return code;
}
