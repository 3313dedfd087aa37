/* Gradient of expose.cl: dL/dx = gain dL/dy; parts[pixel] are dL/dgain, dL/doffset by colour.
 *
 * The parts are summed afterwards, in a fixed order. Index space: pixels.
 *
 * Buffers: image, by_exposed, by_image[pixels, 3], parts[pixels, 6]. */

#include "include/portable.h"

KERNEL void expose_grad(
    __global const float *restrict image, __global const float *restrict by_exposed,
    __global float *restrict by_image, __global float *restrict parts, float4 gain, int pixels)
{
  const long i = get_global_id(0);
  if (i >= pixels) return;
  const float gains[3] = {gain.x, gain.y, gain.z};
  for (int c = 0; c < 3; c++) {
    const float by = by_exposed[3 * i + c];
    by_image[3 * i + c] = gains[c] * by;
    parts[6 * i + c] = image[3 * i + c] * by;
    parts[6 * i + 3 + c] = by;
  }
}
