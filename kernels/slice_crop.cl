/* Pairs of rows become an image: the last step of the inverse transform.
 *
 *     image[slice][c][x] = down[c] across[x] re fields[x - middle][c],
 *
 * with the imaginary part for rows c + pairs. `down` and `across` divide out what the gridding's
 * kernel does to the image. Index space: (blocks of LANES pixels of a row, blocks of LANES pairs,
 * parts). */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier_rays.h"

KERNEL void slice_crop(
    __global const float *restrict fields, __global float *restrict image,
    __global const float *restrict down, __global const float *restrict across,
    int slice, int height, int width, int middle, int edge, int pairs)
{
  const int x = (int)get_global_id(0) * LANES, c = (int)get_global_id(1) * LANES;
  const int part = (int)get_global_id(2), row0 = part * pairs + c;
  if (x >= width) return;
  __global const float *in = fields + (long)part * edge * pairs + c;
  lanes block[LANES];
  UNROLL for (int k = 0; k < LANES; k++) {
    const int row = x + k < middle ? x + k - middle + edge : x + k - middle;
    block[k] = x + k < width ? LOAD(in + (long)row * pairs) : (lanes)0;
  }
  TRANSPOSE(block)
  const lanes weight = load_between(across, x, width);
  for (int k = 0; k < LANES; k++) {
    if (row0 + k >= height) continue;
    __global float *out = image + ((long)slice * height + row0 + k) * width;
    store_between(out, x, width, down[row0 + k] * weight * block[k]);
  }
}
