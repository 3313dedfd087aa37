/* What both coverage kernels ask of a view and of a block of LANES frequencies.
 *
 * Lengths are in diameters of the target and frequencies in cycles per diameter, so that
 * rho^2 = exp(-8 u^2). Beyond |u| = REACH it is taken as zero: 7e-10.
 *
 * A view has ROW numbers: the unit vector n, weight, pixel, 1 / cutoff, blur, and one unused. A
 * block on a CPU has a box that its frequencies lie in, its middle and half its edges; a view whose
 * slab passes by the box is skipped, which changes no bit, since the box is tested with a margin
 * that no rounding fills. */

#include "include/exponential.h"
#include "include/sampling/optical_transfer.h"

#define ROW 8
#define REACH 1.625f
#define MARGIN 1.75f
/* Arguments of quotients stay above this. */
#define LEAST 1e-20f

#if LANES == 8
#define NEAR(n, boxes, block, kx, ky, kz) near_box(n, (boxes) + (long)(block) * 6)
#else
#define NEAR(n, boxes, block, kx, ky, kz) (magnitude((n)[0] * (kx) + (n)[1] * (ky) + (n)[2] * (kz)) < MARGIN)
#endif

static float magnitude(float v) { return v < 0 ? -v : v; }

/* Whether the slab of a view meets a box. */
static int near_box(__global const float *n, __global const float *box) {
  const float middle = n[0] * box[0] + n[1] * box[1] + n[2] * box[2];
  const float half_edge = magnitude(n[0]) * box[3] + magnitude(n[1]) * box[4] + magnitude(n[2]) * box[5];
  return magnitude(middle) < half_edge + MARGIN;
}

/* Frequencies against a view: u = n . k, what of k is across n, its length, and rho^2. */
typedef struct {
  lanes u, x, y, z, across, window;
} slab;

static slab slab_of(__global const float *n, lanes kx, lanes ky, lanes kz) {
  slab s;
  s.u = n[0] * kx + n[1] * ky + n[2] * kz;
  s.x = kx - n[0] * s.u;
  s.y = ky - n[1] * s.u;
  s.z = kz - n[2] * s.u;
  s.across = sqrt(s.x * s.x + s.y * s.y + s.z * s.z);
  const lanes square = s.u * s.u;
  s.window = square < REACH * REACH ? power_of_two(-11.5415603f * square) : 0;
  return s;
}

static lanes at_least(lanes v, float least) { return v > least ? v : least; }
