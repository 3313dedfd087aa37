/* An image of three colours as a photograph with its own exposure: y = gain x + offset, by colour.
 *
 * Index space: pixels.
 *
 * Buffers: image, exposed[pixels, 3]. */

#include "include/portable.h"

KERNEL void expose(
    __global const float *restrict image, __global float *restrict exposed, float4 gain, float4 offset, int pixels)
{
  const long i = get_global_id(0);
  if (i >= pixels) return;
  exposed[3 * i] = gain.x * image[3 * i] + offset.x;
  exposed[3 * i + 1] = gain.y * image[3 * i + 1] + offset.y;
  exposed[3 * i + 2] = gain.z * image[3 * i + 2] + offset.z;
}
