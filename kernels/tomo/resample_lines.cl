/* Read the rows of projections between samples, along the bins or along the rows.
 *
 *     out[view][r][k] = sum over j of weights[r][j][k] stack[view][place of (r, k), tap j]
 *
 * Weights and places are those of an interpolation that is the same in every view. Tap j of
 * (r, k) is bin k + start + j of row first_row + r (ALONG_ROWS 0), or row start + j of bin k
 * (ALONG_ROWS 1), with `start` shared by each block of eight bins; weights have room for that and
 * for whole blocks, `stride` to a line. Beyond the detector its last sample goes on.
 *
 * Index space: (runs of RUN bins, views, rows of the result).
 *
 * Buffers: stack[along1, rows_in, bins], out[along1, rows, bins], weights[along2, TAPS, stride],
 * starts[along2, stride / 8]. */

#include "include/portable.h"

#ifndef RUN
#define RUN 8
#endif
#ifndef TAPS
#define TAPS 13
#endif
#ifndef ALONG_ROWS
#define ALONG_ROWS 0
#endif

static int within(int i, int count) { return i < 0 ? 0 : i < count ? i : count - 1; }

KERNEL void resample_lines(
    __global const float *restrict stack, __global float *restrict out,
    __global const float *restrict weights, __global const int *restrict starts,
    int first_row, int rows_in, int rows, int bins, int stride)
{
  const int begin = (int)get_global_id(0) * RUN;
  const int view = (int)get_global_id(1), r = (int)get_global_id(2);
  const int end = begin + RUN < bins ? begin + RUN : bins;
  __global const float *source = stack + (long)view * rows_in * bins;
  __global const float *w = weights + (long)r * TAPS * stride;
  __global float *line = out + ((long)view * rows + r) * bins;
#if !ALONG_ROWS
  source += (long)within(first_row + r, rows_in) * bins;
#endif
  for (int k = begin; k < end; k += LANES) {
    const int start = starts[(long)r * (stride / 8) + k / 8];
#if ALONG_ROWS
    const int inside = k + LANES <= bins;
#else
    const int inside = k + start >= 0 && k + LANES <= bins && k + LANES - 1 + start + TAPS <= bins;
#endif
    if (inside) {
      lanes sum = 0;
      for (int j = 0; j < TAPS; j++) {
#if ALONG_ROWS
        const lanes sample = LOAD(source + (long)within(start + j, rows_in) * bins + k);
#else
        const lanes sample = LOAD(source + k + start + j);
#endif
        sum = sum + LOAD(w + (long)j * stride + k) * sample;
      }
      STORE(line + k, sum);
    } else {
      for (int n = k; n < k + LANES && n < bins; n++) {
        float sum = 0;
        for (int j = 0; j < TAPS; j++) {
#if ALONG_ROWS
          const float sample = source[(long)within(start + j, rows_in) * bins + n];
#else
          const float sample = source[within(n + start + j, bins)];
#endif
          sum += w[(long)j * stride + n] * sample;
        }
        line[n] = sum;
      }
    }
  }
}
