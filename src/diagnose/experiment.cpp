/* The next experiment: of a menu of protocols, the one on which the rivals' simulations differ most. */
#include <algorithm>
#include <cmath>

#include <tactus/device.h>

#include "diagnose/report.hpp"

namespace tactus::explain
{

const tactus_experiment *propose(Store &store, const Work &work, const char *device)
{
	(void)store;
	(void)work;
	(void)device;
	return nullptr;
}

} // namespace tactus::explain
