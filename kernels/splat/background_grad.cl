/* A run's part in the gradient of the background: the sum over its pixels of transmittance times dL/dC.
 *
 * Four channels of LANES pixels are read at a time (include/splat/splat_rows.h, whose rows are
 * pixels here); each lane keeps its own sum to the end of the run. sum_columns adds the runs in a
 * fixed order.
 *
 * Index space: (runs of RUN pixels).
 *
 * Buffers: grad_image[pixels, CHANNELS], transmittance[pixels], parts[(pixels + RUN - 1) / RUN, CHANNELS]. */

#include "include/portable.h"
#include "include/splat/splat_rows.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif

/* Some channels from one on, no more than four. */
static void sum_channels(
    __global const float *grad_image, __global const float *transmittance, int pixels, const int from,
    const int some, __global float *part)
{
  lanes total[4];
  UNROLL for (int k = 0; k < 4; k++) total[k] = 0;
  EACH_RUN(first, pixels) {
    const Rows rows = rows_at(first, pixels);
    const lanes left = read_numbers(transmittance, rows);
    lanes by[4];
    read_columns(grad_image, CHANNELS, from, some, rows, by);
    UNROLL for (int k = 0; k < some; k++) total[k] += are_there(rows) ? left * by[k] : 0;
  }
  UNROLL for (int k = 0; k < some; k++) part[from + k] = SUM_OF_LANES(total[k]);
}

KERNEL void background_grad(
    __global const float *restrict grad_image, __global const float *restrict transmittance,
    __global float *restrict parts, int pixels)
{
  const long run = get_global_id(0);
  if (!HAS_RUN(pixels)) return;
  __global float *part = parts + run * CHANNELS;
  for (int n = 0; n + 4 <= CHANNELS; n += 4) sum_channels(grad_image, transmittance, pixels, n, 4, part);
  if (CHANNELS % 4) sum_channels(grad_image, transmittance, pixels, CHANNELS / 4 * 4, CHANNELS % 4, part);
}
