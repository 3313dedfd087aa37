/* Gradient of expose.cl by the image: dL/dx = gain dL/dy, by colour.
 *
 * Index space: pixels.
 *
 * Buffers: by_exposed, by_image[pixels, 3]. */

#include "include/portable.h"

KERNEL void expose_grad(
    __global const float *restrict by_exposed, __global float *restrict by_image, float4 gain, int pixels)
{
  const long i = get_global_id(0);
  if (i >= pixels) return;
  by_image[3 * i] = gain.x * by_exposed[3 * i];
  by_image[3 * i + 1] = gain.y * by_exposed[3 * i + 1];
  by_image[3 * i + 2] = gain.z * by_exposed[3 * i + 2];
}
