/* The version of the library that runs. */
#include <tactus/version.h>

const char *tactus_version(void)
{
	return TACTUS_VERSION;
}
