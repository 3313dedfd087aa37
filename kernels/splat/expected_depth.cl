/* Turn the last channel of an image from accumulated into expected depth.
 *
 *     E = D / alpha,   alpha = max(1 - transmittance, LEAST_ALPHA)
 *
 * Index space: (pixels).
 *
 * Buffers: image[pixels, channels], transmittance[pixels]. */

#include "include/portable.h"
#include "include/splat/expected_depth.h"

KERNEL void expected_depth(
    __global float *restrict image, __global const float *restrict transmittance,
    int pixels, int channels)
{
  const long pixel = get_global_id(0);
  if (pixel >= pixels) return;
  image[pixel * channels + channels - 1] /= held_alpha(transmittance[pixel]);
}
