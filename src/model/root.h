/* A bracketed root: Boost.Math's TOMS 748 (Alefeld, Potra, Shi 1995) behind a C interface. */
#ifndef TACTUS_ROOT_H
#define TACTUS_ROOT_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * A root of f inside [a, b], where f(a) = fa and f(b) = fb have opposite signs, to a few ulp or to `tolerance`,
 * whichever is wider. NaN if f is not finite on the way. Allocates nothing; no exception leaves it.
 */
double tactus_root(double (*f)(void *context, double x), void *context, double a, double fa, double b, double fb,
				   double tolerance);

#ifdef __cplusplus
}
#endif

#endif
