/* A smaller image: the means of blocks of FACTOR x FACTOR pixels.
 *
 * Where pixels count differently, by weights m, a mean is that of what counts,
 *
 *     out = sum_b m_b in_b / sum_b m_b,    m_out = sum_b m_b / FACTOR^2,
 *
 * and a plain one where nothing does. Rows and columns at the lower and right edge that fill no
 * block are left out.
 *
 * Index space: (pixels of the smaller image).
 *
 * Buffers: image[FACTOR * rows, columns, CHANNELS], weights[WEIGHTED ? FACTOR * rows * columns : 0],
 * smaller[rows * width, CHANNELS], smaller_weights[WEIGHTED ? rows * width : 0]. */

#include "include/portable.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef FACTOR
#define FACTOR 2
#endif
#ifndef WEIGHTED
#define WEIGHTED 0
#endif

KERNEL void image_shrink(
    __global const float *restrict image, __global const float *restrict weights,
    __global float *restrict smaller, __global float *restrict smaller_weights, int rows, int width,
    int columns)
{
  const long i = get_global_id(0);
  if (i >= (long)rows * width) return;
  const long corner = (i / width * columns + i % width) * FACTOR;
  float sum[CHANNELS], plain[CHANNELS], counted = 0;
  for (int k = 0; k < CHANNELS; k++) sum[k] = plain[k] = 0;
  for (int y = 0; y < FACTOR; y++) {
    for (int x = 0; x < FACTOR; x++) {
      const long pixel = corner + (long)y * columns + x;
#if WEIGHTED
      const float m = weights[pixel];
#else
      const float m = 1;
#endif
      counted += m;
      for (int k = 0; k < CHANNELS; k++) {
        const float value = image[pixel * CHANNELS + k];
        sum[k] += m * value;
        plain[k] += value;
      }
    }
  }
  for (int k = 0; k < CHANNELS; k++)
    smaller[i * CHANNELS + k] =
        counted > 0 ? sum[k] / counted : plain[k] * (1.0f / (FACTOR * FACTOR));
#if WEIGHTED
  smaller_weights[i] = counted * (1.0f / (FACTOR * FACTOR));
#endif
}
