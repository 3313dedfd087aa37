/* An image becomes pairs of rows: the transpose of slice_crop_gpu, and the transform's first step.
 *
 * Beyond the image there are zeros. Index space: (blocks of LANES pairs, blocks of LANES columns of
 * the padded image, parts).
 *
 * Buffers: image[slice + 1, height, width], fields[along2, edge, pairs], down[height], across[width]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"

KERNEL void slice_place(
    __global const float *restrict image, __global float *restrict fields,
    __global const float *restrict down, __global const float *restrict across,
    int slice, int height, int width, int middle, int edge, int pairs)
{
  const int c = (int)get_global_id(0) * LANES, x = (int)get_global_id(1) * LANES;
  const int part = (int)get_global_id(2), row0 = part * pairs + c;
  if (c >= pairs) return;
  const lanes weight = load_between(across, x, width);
  lanes block[LANES];
  for (int k = 0; k < LANES; k++) {
    block[k] = 0;
    if (row0 + k < height && x < width)
      block[k] = down[row0 + k] * weight *
                 load_between(image + ((long)slice * height + row0 + k) * width, x, width);
  }
  TRANSPOSE(block)
  __global float *out = fields + (long)part * edge * pairs + c;
  UNROLL for (int k = 0; k < LANES; k++) {
    const int row = x + k < middle ? x + k - middle + edge : x + k - middle;
    if (x + k < edge) STORE(out + (long)row * pairs, block[k]);
  }
}
