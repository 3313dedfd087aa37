/* Multiply the spectra of real rows by responses, between two transforms of half their length.
 *
 * Sample k of the transform of x[2n] + i x[2n+1] holds the spectra E and O of the even and of the
 * odd bins: with Z' the conjugate of sample (length - k) mod length,
 *
 *     E = (Z + Z') / 2,   O = (Z - Z') / (2i),   X[k] = E + w O,   conj X[length - k] = E - w O,
 *     w = exp(-i pi k / length).
 *
 * A real response R makes of the two, with s and d half the sum and half the difference of R[k] and
 * R[length - k],
 *
 *     E <- s E + d w O,   O <- s O + d conj(w) E,
 *
 * which are put together again as E + i O and, at length - k, conj E + i conj O. `sums` and
 * `differences` hold s and d as (length / 2 + 1, filters); each filter serves `rows_per_filter`
 * rows. `turns` holds w as pairs. Columns are a multiple of LANES.
 *
 * Index space: (runs of RUN columns, length / 2 + 1). */

#include "include/portable.h"

#ifndef RUN
#define RUN (LANES == 8 ? 4096 : 1)
#endif
#ifndef SHARED
#define SHARED 0
#endif

/* The filter's numbers for LANES rows: one filter for all, or the one that each row has. */
#if SHARED
#define OF_ROWS(p) ((p)[0])
#elif LANES == 8
#define OF_ROWS(p) \
  ((lanes)((p)[index[0]], (p)[index[1]], (p)[index[2]], (p)[index[3]], \
           (p)[index[4]], (p)[index[5]], (p)[index[6]], (p)[index[7]]))
#else
#define OF_ROWS(p) ((p)[index[0]])
#endif

KERNEL void rows_weigh(
    __global real *restrict planes, __global const real *restrict sums,
    __global const real *restrict differences, __global const real *restrict turns,
    int first, int rows_per_filter, int filters, int length, int columns)
{
  const int k = (int)get_global_id(1), begin = (int)get_global_id(0) * RUN;
  const int mirror = k > 0 ? length - k : 0;
  const int end = begin + RUN < columns ? begin + RUN : columns;
  const real c = turns[2 * k], s = turns[2 * k + 1];
  __global const real *half_sum = sums + (long)k * filters;
  __global const real *half_difference = differences + (long)k * filters;
  __global real *re = planes, *im = planes + (long)length * columns;
  for (int x = begin; x < end; x += LANES) {
    const long here = (long)k * columns + x, there = (long)mirror * columns + x;
#if !SHARED
    int index[LANES], filter = (first + x) / rows_per_filter;
    int left = (filter + 1) * rows_per_filter - (first + x);
    UNROLL for (int n = 0; n < LANES; n++) {
      /* Columns past the last row take the last filter. */
      index[n] = filter < filters ? filter : filters - 1;
      if (--left == 0) { filter++; left = rows_per_filter; }
    }
#endif
    const lanes ar = LOAD(re + here), ai = LOAD(im + here);
    const lanes br = LOAD(re + there), bi = LOAD(im + there);
    const lanes er = (ar + br) / 2, ei = (ai - bi) / 2, or = (ai + bi) / 2, oi = (br - ar) / 2;
    const lanes p = OF_ROWS(half_sum), q = OF_ROWS(half_difference);
    /* w O and conj(w) E */
    const lanes tr = c * or - s * oi, ti = c * oi + s * or, ur = c * er + s * ei, ui = c * ei - s * er;
    const lanes fr = p * er + q * tr, fi = p * ei + q * ti, gr = p * or + q * ur, gi = p * oi + q * ui;
    STORE(re + here, fr - gi);
    STORE(im + here, fi + gr);
    STORE(re + there, fr + gi);
    STORE(im + there, gr - fi);
  }
}
