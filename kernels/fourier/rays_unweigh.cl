/* Rays of the spectrum become transforms of pairs of views: the transpose of rays_weigh_gpu.
 *
 * Sample l of a ray, after the conjugate factor, belongs to place l of the periodic transform of a
 * real view, and its conjugate to place -l:
 *
 *     a[l] = sum over j >= 0 of ray[l + j length] + sum over j >= 1 of conj ray[j length - l],
 *     Z[l] = a[l] + i b[l],    Z[-l] = conj a[l] + i conj b[l],      l = 0 .. length / 2,
 *
 * a and b being the views of a pair. Index space: (blocks of LANES columns, runs of RUN places).
 *
 * Buffers: rays[2, count, samples], fields[2, length, columns], turns[2 * columns], shadows[2, 2 * columns],
 * signs[2 * columns], bins[samples]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/turn.h"
#include "include/fourier/ray_response.h"
#include "include/fourier/fourier_rays.h"

#ifndef RUN
#define RUN (LANES == 8 ? 256 : 1)
#endif

/* Samples first .. first + LANES - 1 of LANES rays, which then run along the lanes. */
static void load_samples(
    __global const float *rays, int ray0, int count, int first, int samples, lanes *values)
{
  lanes block[LANES];
  UNROLL for (int k = 0; k < LANES; k++)
    block[k] = ray0 + k < count ? load_between(rays + (long)(ray0 + k) * samples, first, samples) : (lanes)0;
  TRANSPOSE(block)
  UNROLL for (int k = 0; k < LANES; k++) values[k] = block[k];
}

KERNEL void rays_unweigh(
    __global const float *restrict rays, __global float *restrict fields,
    __global const uint *restrict turns, __global const float *restrict shadows,
    __global const float *restrict signs, __global const float *restrict bins, int count,
    int samples, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES;
  if (c >= columns) return;
  const int begin = (int)get_global_id(1) * RUN;
  const int end = begin + RUN < length / 2 + 1 ? begin + RUN : length / 2 + 1;
  __global float *zr = fields + c, *zi = zr + (long)length * columns;
  for (int l0 = begin; l0 < end; l0 += LANES) {
    lanes re[2][LANES], im[2][LANES];
    UNROLL for (int part = 0; part < 2; part++) {
      const int ray0 = part * columns + c;
      const ray_shape shape = shape_of(turns, shadows, ray0, 2 * columns);
      const lanes sign = LOAD(signs + ray0);
      UNROLL for (int k = 0; k < LANES; k++) re[part][k] = im[part][k] = 0;
      /* Even n: samples n/2 periods above l. Odd n: those that lie l below a whole period. */
      for (int n = 0; n / 2 * length < samples; n++) {
        const int back = n % 2, period = (n + 1) / 2 * length;
        const int first = back ? period - l0 - (LANES - 1) : period + l0;
        lanes qr[LANES], qi[LANES];
        load_samples(rays, ray0, count, first, samples, qr);
        load_samples(rays + (long)count * samples, ray0, count, first, samples, qi);
        UNROLL for (int k = 0; k < LANES; k++) {
          const int at = back ? LANES - 1 - k : k;
          const int sample = first + at < 0 ? 0 : first + at < samples ? first + at : samples - 1;
          const response w = ray_response(sample, &shape, bins[sample]);
          const lanes r = qr[at], i = sign * qi[at];
          re[part][k] = re[part][k] + (r * w.real + i * w.imaginary);
          im[part][k] = im[part][k] + (back ? -1.0f : 1.0f) * (i * w.real - r * w.imaginary);
        }
      }
    }
    UNROLL for (int k = 0; k < LANES; k++) {
      const int l = l0 + k, m = l > 0 ? length - l : 0;
      if (l > length / 2) continue;
      /* A real view's transform is real at zero and at half the period. */
      const float side = l == 0 || l == m ? 0.0f : 1.0f;
      STORE(zr + (long)m * columns, re[0][k] + side * im[1][k]);
      STORE(zi + (long)m * columns, re[1][k] - side * im[0][k]);
      STORE(zr + (long)l * columns, re[0][k] - side * im[1][k]);
      STORE(zi + (long)l * columns, side * im[0][k] + re[1][k]);
    }
  }
}
