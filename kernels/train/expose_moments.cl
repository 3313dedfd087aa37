/* What least squares need to know of a photograph y beside the image x that is drawn of it: of every
 * pixel and colour, weighted,
 *
 *     parts[pixel] = (w, w x, w y, w x x, w x y),    x, y, ... for three colours each
 *
 * They are summed afterwards, in a fixed order. Index space: pixels; weighted is 0 or 1.
 *
 * Buffers: image, target[pixels, 3], weights[weighted * pixels], parts[pixels, 13]. */

#include "include/portable.h"

KERNEL void expose_moments(
    __global const float *restrict image, __global const float *restrict target,
    __global const float *restrict weights, __global float *restrict parts, int weighted, int pixels)
{
  const long i = get_global_id(0);
  if (i >= pixels) return;
  const float weight = weighted ? weights[i] : 1;
  __global float *part = parts + 13 * i;
  part[0] = weight;
  for (int c = 0; c < 3; c++) {
    const float x = image[3 * i + c], y = target[3 * i + c];
    part[1 + c] = weight * x;
    part[4 + c] = weight * y;
    part[7 + c] = weight * x * x;
    part[10 + c] = weight * x * y;
  }
}
