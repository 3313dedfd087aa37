/* The fields of a Fourier transform become the channels of an image again: fft_pack.cl backwards.
 *
 * Values are multiplied by `scale`, one over the number of samples of a plane, and by the mask if
 * MASKED; channels behind the last are zero. `squares` gets the sum of the squares of each row.
 * Index space: rows of the image.
 *
 * Buffers: fields[2 * FIELDS, rows, columns], mask[MASKED ? height * width : 0],
 * image[height, width, depth], squares[height]. */

#include "include/portable.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef MASKED
#define MASKED 0
#endif
#define FIELDS ((CHANNELS + 1) / 2)

KERNEL void fft_unpack(
    __global const float *restrict fields, __global const float *restrict mask,
    __global float *restrict image, __global float *restrict squares,
    int height, int width, int depth, int rows, int columns, float scale)
{
  const int y = (int)get_global_id(0);
  if (y >= height) return;
  const long plane = (long)rows * columns;
  float sum = 0;
  for (int c = 0; c < depth; c++) {
    __global const float *restrict row = fields + (c % 2 * FIELDS + c / 2) * plane + (long)y * columns;
    for (int x = 0; x < width; x++) {
      float value = c < CHANNELS ? scale * row[x] : 0;
#if MASKED
      value *= mask[(long)y * width + x];
#endif
      image[((long)y * width + x) * depth + c] = value;
      sum += value * value;
    }
  }
  squares[y] = sum;
}
