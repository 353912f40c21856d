/* Marks what the shared library exports; everything else is hidden. */
#ifndef TACTUS_EXPORT_H
#define TACTUS_EXPORT_H

#if defined(__GNUC__)
#define TACTUS_API __attribute__((visibility("default")))
#define TACTUS_PRINTF(format, first) __attribute__((format(printf, format, first)))
#else
#define TACTUS_API
#define TACTUS_PRINTF(format, first)
#endif

#endif
