/* Jumps, or something that wanders. */
#ifndef TACTUS_DIAGNOSE_WANDER_HPP
#define TACTUS_DIAGNOSE_WANDER_HPP

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/*
 * Whether an effect with jumps is one, or approaches something that wanders: a walk of what the jumps move is put
 * beside both models. True if the jumps are better by limits.evidence than the walk alone, and leave it next to
 * nothing.
 */
bool leaps(const Problem &problem, const Fit &without, const Fit &with, const tactus_effect *effect);

} // namespace tactus::explain

#endif
