/* One pass of a Fourier transform down the columns of planes: Stockham's autosort of radix RADIX.
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
 * Index space: (runs of RUN columns, butterflies, fields). */

#include "include/portable.h"

#ifndef RADIX
#define RADIX 4
#endif
#ifndef WEIGHTED
#define WEIGHTED 0
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif

#if DOUBLE
#define HALF_ROOT3 0.86602540378443865
#else
#define HALF_ROOT3 0.86602540f
#endif

/* Stores the complex product a z. */
static void store_turned(
    __global real *restrict re, __global real *restrict im, lanes zr, lanes zi, real ar, real ai)
{
  STORE(re, ar * zr - ai * zi);
  STORE(im, ar * zi + ai * zr);
}

#if WEIGHTED
#define READ(p, n) (LOAD(p + (n)) * LOAD(weight + (n)))
#else
#define READ(p, n) LOAD(p + (n))
#endif

KERNEL void fft_pass(
    __global const real *restrict in, __global real *restrict out, __global const real *restrict turns,
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
    __global const real *restrict xr = in + re + field + from + c;
    __global const real *restrict xi = in + im + field + from + c;
    __global real *restrict yr = out + re + to + c, *restrict yi = out + im + to + c;
#if WEIGHTED
    __global const real *restrict weight = weights + from + c;
#endif
    const lanes ar = READ(xr, 0), ai = READ(xi, 0), br = READ(xr, step), bi = READ(xi, step);
#if RADIX == 2
    store_turned(yr, yi, ar + br, ai + bi, wr[0], wi[0]);
    store_turned(yr + leap, yi + leap, ar - br, ai - bi, wr[1], wi[1]);
#elif RADIX == 3
    const lanes cr = READ(xr, 2 * step), ci = READ(xi, 2 * step);
    /* a - (b + c) / 2, and sqrt(3)/2 (b - c), which a quarter of a turn adds to it. */
    const lanes sr = br + cr, si = bi + ci, mr = ar - 0.5f * sr, mi = ai - 0.5f * si;
    const lanes ur = HALF_ROOT3 * (br - cr), ui = HALF_ROOT3 * (bi - ci);
    store_turned(yr, yi, ar + sr, ai + si, wr[0], wi[0]);
    store_turned(yr + leap, yi + leap, mr + ui, mi - ur, wr[1], wi[1]);
    store_turned(yr + 2 * leap, yi + 2 * leap, mr - ui, mi + ur, wr[2], wi[2]);
#else
    const lanes cr = READ(xr, 2 * step), ci = READ(xi, 2 * step);
    const lanes dr = READ(xr, 3 * step), di = READ(xi, 3 * step);
    /* a + c, a - c, b + d, and i (d - b), whose sign tells the second output from the fourth. */
    const lanes sr = ar + cr, si = ai + ci, mr = ar - cr, mi = ai - ci;
    const lanes tr = br + dr, ti = bi + di, ur = bi - di, ui = dr - br;
    store_turned(yr, yi, sr + tr, si + ti, wr[0], wi[0]);
    store_turned(yr + leap, yi + leap, mr + ur, mi + ui, wr[1], wi[1]);
    store_turned(yr + 2 * leap, yi + 2 * leap, sr - tr, si - ti, wr[2], wi[2]);
    store_turned(yr + 3 * leap, yi + 3 * leap, mr - ur, mi - ui, wr[3], wi[3]);
#endif
  }
}
