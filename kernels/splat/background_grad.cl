/* Each pixel's part in the gradient of the background: transmittance times dL/dC.
 *
 * Index space: (pixels). The parts are then summed by sum_columns in a fixed order. */

#include "include/portable.h"

KERNEL void background_grad(
    __global const float *restrict grad_image, __global const float *restrict transmittance,
    __global float *restrict parts, int pixels, int channels)
{
  const int pixel = (int)get_global_id(0);
  if (pixel >= pixels) return;
  const long at = (long)pixel * channels;
  for (int n = 0; n < channels; n++) parts[at + n] = transmittance[pixel] * grad_image[at + n];
}
