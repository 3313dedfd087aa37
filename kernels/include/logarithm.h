/* ln x of positive normal numbers, to 2e-7 of it or of 1: with x = m 2^e, m about 1,
 * ln m = 2 artanh((m - 1) / (m + 1)). The built-in takes longer than all else of a splat on PoCL. */

#include "include/exponential.h"

/* Below it some devices take a number for zero. */
#define LEAST_NORMAL 1.2e-38f

static lanes natural_log(lanes x) {
  const lanes_int e = (AS_INT(x) - 0x3f3504f3) >> 23;
  const lanes m = AS_LANES(AS_INT(x) - (e << 23)), s = (m - 1) / (m + 1), t = s * s;
  const lanes series = 1 + t * (1 / 3.0f + t * (1 / 5.0f + t * (1 / 7.0f + t * (1 / 9.0f))));
  return TO_FLOAT(e) * 0.69314718f + 2 * s * series;
}
