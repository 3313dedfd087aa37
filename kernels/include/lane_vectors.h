/* Vectors and matrices of three whose numbers are lanes, so that eight splats are computed at a time.
 *
 * OpenCL has no vector of vectors: a CPU's is a struct of three vectors of eight, and sums and
 * multiples are functions. With a single lane it is a float3, on which OpenCL's own operators work
 * as well. Functions take the place of built-in ones that are calls on PoCL (dot, cross, sqrt).
 * NaN and infinity are found by their bits, since a compiler may take v != v for false.
 *
 * Nothing here branches on a number: lanes that have none are left aside by masks, which are -1 in
 * the lanes of a vector where a condition holds and 1 in a single one. */

#include "include/exponential.h"

#if LANES == 8
typedef struct {
  lanes x, y, z;
} lanes3;
#else
typedef float3 lanes3;
#endif

typedef struct {
  lanes3 x, y, z;
} lane_rows;

/* Squares between these have a root and an inverse that are normal numbers. */
#define LEAST_SQUARE 1.2e-38f
#define MOST_SQUARE 1e38f

static lanes3 lanes3_of(lanes x, lanes y, lanes z) {
  lanes3 v;
  v.x = x;
  v.y = y;
  v.z = z;
  return v;
}

static lanes3 plus(lanes3 a, lanes3 b) { return lanes3_of(a.x + b.x, a.y + b.y, a.z + b.z); }

static lanes3 minus(lanes3 a, lanes3 b) { return lanes3_of(a.x - b.x, a.y - b.y, a.z - b.z); }

static lanes3 times(lanes s, lanes3 v) { return lanes3_of(s * v.x, s * v.y, s * v.z); }

static lanes3 where(lanes_int holds, lanes3 v) {
  return lanes3_of(holds ? v.x : 0, holds ? v.y : 0, holds ? v.z : 0);
}

static lanes dot_of(lanes3 a, lanes3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static lanes3 cross_of(lanes3 a, lanes3 b) {
  return lanes3_of(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* A number for all lanes times one of each. */
static lanes dot_with(float3 a, lanes3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static lanes larger(lanes a, lanes b) { return a > b ? a : b; }

static lanes_int no_number(lanes v) { return (AS_INT(v) & 0x7f800000) == 0x7f800000; }

static lanes_int is_nan(lanes v) { return (AS_INT(v) & 0x7fffffff) > 0x7f800000; }

static lanes_int no_numbers(lanes3 v) { return no_number(v.x) | no_number(v.y) | no_number(v.z); }

/* Whether a condition holds in any lane. */
static int any_lane(lanes_int holds) {
#if LANES == 8
  const int4 four = holds.lo | holds.hi;
  const int2 two = four.lo | four.hi;
  return two.x | two.y;
#else
  return holds;
#endif
}

/* One over the root of a square, and the root: a first guess from the bits, 3 % off, and three of
 * Newton's steps, to 2e-7. Zero has the root zero. */
static lanes inverse_root(lanes square) {
#if LANES == 8
  lanes r = AS_LANES(0x5f375a86 - (AS_INT(square) >> 1));
  UNROLL for (int n = 0; n < 3; n++) r = r * (1.5f - 0.5f * square * r * r);
  return r;
#else
  return 1 / sqrt(square);
#endif
}

static lanes root_of(lanes square) {
#if LANES == 8
  const lanes r = inverse_root(square), s = square * r;
  return s + 0.5f * r * (square - s * s);
#else
  return sqrt(square);
#endif
}
