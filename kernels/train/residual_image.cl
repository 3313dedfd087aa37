/* What a picture is off by, as an image whose gradient says which splats show it.
 *
 * With x the image, y the target of C channels and m the weights (one where there are none), a pixel
 * becomes (m 1/C sum |x - y|, m, 0, ...). Drawing is linear in what splats show: the gradient of its
 * inner product with an image g by a splat's features is the sum over pixels of the splat's share in
 * the pixel, alpha times transmittance, times g. So channel 0 yields the residual that each splat
 * shows, and channel 1 how many pixels it makes up.
 *
 * Index space: pixels.
 *
 * Buffers: image, residual[pixels, IMAGE_CHANNELS], target[pixels, CHANNELS],
 * weights[WEIGHTED ? pixels : 0]. */

#include "include/portable.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef IMAGE_CHANNELS
#define IMAGE_CHANNELS CHANNELS
#endif
#ifndef WEIGHTED
#define WEIGHTED 0
#endif

KERNEL void residual_image(
    __global const float *restrict image, __global const float *restrict target,
    __global const float *restrict weights, __global float *restrict residual, int pixels)
{
  const long i = get_global_id(0);
  if (i >= pixels) return;
  float sum = 0;
  for (int k = 0; k < CHANNELS; k++) {
    const float d = image[IMAGE_CHANNELS * i + k] - target[CHANNELS * i + k];
    sum += d < 0 ? -d : d;
  }
#if WEIGHTED
  const float m = weights[i];
#else
  const float m = 1;
#endif
  residual[IMAGE_CHANNELS * i] = m * sum * (1.0f / CHANNELS);
  residual[IMAGE_CHANNELS * i + 1] = m;
  for (int k = 2; k < IMAGE_CHANNELS; k++) residual[IMAGE_CHANNELS * i + k] = 0;
}
