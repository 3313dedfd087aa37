/* Gradient of expected depth E = D / alpha, of which `image` holds E in its last channel.
 *
 *     dL/dD = g / alpha,      dL/dT += g E / alpha   (T = 1 - alpha; zero where alpha was held)
 *
 * Other channels pass through. Index space: (pixels).
 *
 * Buffers: image, grad_image, by_image[pixels, channels], transmittance, grad_transmittance,
 * by_transmittance[pixels]. */

#include "include/portable.h"
#include "include/splat/expected_depth.h"

KERNEL void expected_depth_grad(
    __global const float *restrict image, __global const float *restrict transmittance,
    __global const float *restrict grad_image, __global const float *restrict grad_transmittance,
    __global float *restrict by_image, __global float *restrict by_transmittance,
    int pixels, int channels)
{
  const long pixel = get_global_id(0), depth = pixel * channels + channels - 1;
  if (pixel >= pixels) return;
  for (int n = 0; n < channels - 1; n++)
    by_image[pixel * channels + n] = grad_image[pixel * channels + n];
  const float alpha = held_alpha(transmittance[pixel]), by_sum = grad_image[depth] / alpha;
  by_image[depth] = by_sum;
  by_transmittance[pixel] =
      grad_transmittance[pixel] + (alpha > LEAST_ALPHA ? by_sum * image[depth] : 0);
}
