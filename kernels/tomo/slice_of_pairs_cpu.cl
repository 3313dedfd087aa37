/* Pairs of rows are transformed back and cropped to a slice of the image, for CPUs.
 *
 * What a GPU does by fft_pass and slice_crop_gpu, BLOCK pairs at a time in the caches of a core (see
 * include/fourier/row_pairs.h). Pairs come as pairs_of_spectrum_cpu leaves them, and are
 * overwritten.
 *
 * Index space: items, each of which takes every so many-th block.
 *
 * Buffers: fields[blocks, 2, length, BLOCK], image[slice + 1, height, width], down[height], across[width],
 * scratch[items, 4, length, BLOCK], turns[length, 2]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fft_block.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/row_pairs.h"

KERNEL void slice_of_pairs_cpu(
    __global float *fields, __global float *restrict image, __global const float *restrict down,
    __global const float *restrict across, int slice, int height, int width, int middle, int pairs,
    __global float *scratch, __global const float *restrict turns, int length, int blocks, int items)
{
  const int item = (int)get_global_id(0);
  if (item >= items) return;
  const block spare[2] = BLOCKS_OF(item, scratch, length);
  const long part = (long)length * BLOCK;
  __global float *out = image + (long)slice * height * width;
  for (int n = item; n < blocks; n += items) {
    const block columns = {fields + 2 * n * part, fields + (2 * n + 1) * part};
    const block both[2] = {columns, spare[0]};
    const block z = both[transform_block_back(both, turns, length)];
    for (int c = 0; c < BLOCK; c += LANES)
      for (int x = 0; x < width; x += LANES) {
        crop_pairs(z.re + c, BLOCK, length, out, down, across, x, n * BLOCK + c, height, width, middle);
        crop_pairs(z.im + c, BLOCK, length, out, down, across, x, pairs + n * BLOCK + c, height, width, middle);
      }
  }
}
