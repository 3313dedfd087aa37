/* One pass of a Fourier transform down the columns of planes: Stockham's autosort of radix RADIX,
 * which is 2, 3, 4, 8 or 9.
 *
 * A transform of length n = RADIX m begins with n/RADIX butterflies, each over the samples that lie
 * m apart, and leaves RADIX transforms of length m. Stockham's form writes what belongs to one of
 * those side by side, so that after all passes everything stands in order and nothing is reversed:
 * with `stride` the product of the radices so far, butterfly b = q + stride p reads samples
 * b + k n/RADIX and writes
 *
 *     y[q + stride (RADIX p + k)] = w^(k p stride) sum_l w^(k l n/RADIX) x[b + l n/RADIX],
 *     w = exp(-2 pi i / n),  k, l = 0 .. RADIX - 1.
 *
 * Real and imaginary parts are planes of their own, `re` and `im` numbers from the start of
 * the buffer: exchanging the two makes it the inverse transform, up to 1/n. `turns` holds w^j as
 * pairs. With WEIGHTED what is read is multiplied by `weights`, a plane for all fields. Columns are a
 * multiple of LANES.
 *
 * Index space: (runs of RUN columns, butterflies, fields).
 *
 * Buffers: source, out[max(re, im) + along2 * length * columns], turns[length, 2],
 * weights[WEIGHTED ? length * columns : 0]. */

#include "include/portable.h"
#include "include/fourier/butterfly.h"

#ifndef RADIX
#define RADIX 4
#endif
#ifndef WEIGHTED
#define WEIGHTED 0
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

#if WEIGHTED
#define READ(p, n) (LOAD(p + (n)) * LOAD(weight + (n)))
#else
#define READ(p, n) LOAD(p + (n))
#endif

KERNEL void fft_pass(
    __global const real *restrict source, __global real *restrict out, __global const real *restrict turns,
    __global const real *restrict weights, long re, long im, int columns, int length, int stride)
{
  const int b = (int)get_global_id(1), p = b / stride, q = b - p * stride;
  const long field = (long)get_global_id(2) * length * columns;
  const long step = (long)(length / RADIX) * columns, leap = (long)stride * columns;
  const long from = (long)b * columns, to = field + (q + (long)stride * RADIX * p) * columns;
  real wr[RADIX], wi[RADIX];
  UNROLL for (int k = 0; k < RADIX; k++) {
    wr[k] = turns[2 * (k * p * stride)];
    wi[k] = turns[2 * (k * p * stride) + 1];
  }
  const int begin = (int)get_global_id(0) * RUN;
  const int end = begin + RUN < columns ? begin + RUN : columns;
  for (int c = begin; c < end; c += LANES) {
    __global const real *restrict xr = source + re + field + from + c;
    __global const real *restrict xi = source + im + field + from + c;
    __global real *restrict yr = out + re + to + c, *restrict yi = out + im + to + c;
#if WEIGHTED
    __global const real *restrict weight = weights + from + c;
#endif
    sample x[RADIX];
    UNROLL for (int l = 0; l < RADIX; l++) {
      x[l].r = READ(xr, l * step);
      x[l].i = READ(xi, l * step);
    }
#if RADIX == 2
    transform2(x, x + 1);
#elif RADIX == 3
    transform3(x, x + 1, x + 2);
#elif RADIX == 4
    transform4(x, x + 1, x + 2, x + 3);
#elif RADIX == 8
    transform8(x);
#else
    transform9(x);
#endif
    UNROLL for (int k = 0; k < RADIX; k++) {
      const sample z = k > 0 ? turned(x[k], wr[k], wi[k]) : x[k];
      STORE(yr + k * leap, z.r);
      STORE(yi + k * leap, z.i);
    }
  }
}
