/* Pairs of rows become an image: the last step of the inverse transform, for GPUs.
 *
 * Index space: (blocks of LANES pixels of a row, blocks of LANES pairs, parts).
 *
 * Buffers: fields[along2, edge, pairs], image[slice + 1, height, width], down[height], across[width]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/row_pairs.h"

KERNEL void slice_crop_gpu(
    __global const float *restrict fields, __global float *restrict image,
    __global const float *restrict down, __global const float *restrict across,
    int slice, int height, int width, int middle, int edge, int pairs)
{
  const int x = (int)get_global_id(0) * LANES, c = (int)get_global_id(1) * LANES;
  const int part = (int)get_global_id(2);
  if (x >= width) return;
  crop_pairs(
      fields + (long)part * edge * pairs + c, pairs, edge, image + (long)slice * height * width, down,
      across, x, part * pairs + c, height, width, middle);
}
