/* Rows of a detector as the columns of a Fourier transform, two bins to a complex sample.
 *
 * A transform of 2 length real numbers is made of one of length complex ones: sample n has bin 2n
 * as its real part and bin 2n + 1 as its imaginary one. Sample k of that transform holds the spectra
 * E and O of the even and of the odd bins: with Z' the conjugate of sample (length - k) mod length,
 *
 *     E = (Z + Z') / 2,   O = (Z - Z') / (2i),   X[k] = E + w O,   conj X[length - k] = E - w O,
 *     w = exp(-i pi k / length).
 *
 * A real response R makes of the two, with s and d half the sum and half the difference of R[k] and
 * R[length - k],
 *
 *     E <- s E + d w O,   O <- s O + d conj(w) E,
 *
 * which are put together again as E + i O and, at length - k, conj E + i conj O.
 *
 * `re` and `im` are the parts of LANES columns, their rows `pitch` numbers apart; `row0` is the
 * detector's row in the first column, of `count`. */

#ifndef SHARED
#define SHARED 0
#endif

/* Bins begin .. end - 1; zeros behind the last. Columns past the last row repeat it. */
static void pack_rows(
    __global const real *restrict rows, __global real *restrict re, __global real *restrict im, long pitch,
    int row0, int count, int bins, int begin, int end)
{
  __global const real *row[LANES];
  UNROLL for (int k = 0; k < LANES; k++)
    row[k] = rows + (long)(row0 + k < count ? row0 + k : count - 1) * bins;
  for (int b = begin; b < end; b += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      block[k] = 0;
      if (b + LANES <= bins) block[k] = LOAD(row[k] + b);
      else for (int n = 0; b + n < bins; n++) ((real *)&block[k])[n] = row[k][b + n];
    }
    TRANSPOSE(block)
    UNROLL for (int k = 0; k < LANES; k++)
      if (b + k < end) STORE(((b + k) & 1 ? im : re) + ((b + k) >> 1) * pitch, block[k]);
  }
}

/* The transpose: each row is multiplied by its view's gain. */
static void unpack_rows(
    __global const real *restrict re, __global const real *restrict im, long pitch,
    __global real *restrict rows, __global const real *restrict gains,
    int row0, int count, int rows_per_view, int bins, int begin, int end)
{
  for (int b = begin; b < end; b += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      const int from = b + k < end ? b + k : end - 1;
      block[k] = LOAD((from & 1 ? im : re) + (from >> 1) * pitch);
    }
    TRANSPOSE(block)
    for (int k = 0; k < LANES && row0 + k < count; k++) {
      __global real *out = rows + (long)(row0 + k) * bins + b;
      const lanes values = gains[(row0 + k) / rows_per_view] * block[k];
      if (b + LANES <= end) STORE(out, values);
      else for (int n = 0; b + n < end; n++) out[n] = ((const real *)&values)[n];
    }
  }
}

/* Which filter each of LANES rows has; those past the last row take the last. */
static void filters_of(int row0, int rows_per_filter, int filters, int *index) {
  int filter = row0 / rows_per_filter, left = (filter + 1) * rows_per_filter - row0;
  UNROLL for (int n = 0; n < LANES; n++) {
    index[n] = filter < filters ? filter : filters - 1;
    if (--left == 0) { filter++; left = rows_per_filter; }
  }
}

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

/* Multiply samples k and length - k by the response. `sums` and `differences` hold s and d as
 * (length / 2 + 1, filters), `half_turns` w as pairs. */
static void weigh_rows(
    __global real *re, __global real *im, long pitch, int k, int length,
    __global const real *restrict sums, __global const real *restrict differences,
    __global const real *restrict half_turns, int filters, const int *index)
{
  const real c = half_turns[2 * k], s = half_turns[2 * k + 1];
  __global const real *half_sum = sums + (long)k * filters;
  __global const real *half_difference = differences + (long)k * filters;
  const long here = k * pitch, there = (k > 0 ? length - k : 0) * pitch;
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
