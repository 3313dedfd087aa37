/* Channels of an image become the complex fields of a Fourier transform, two channels to a field.
 *
 * A response that is real and even treats real and imaginary part alike, so that one transform
 * does for two channels: field f has channel 2f as its real part and 2f + 1 as its imaginary one.
 * Beyond the image, and behind the last channel, there are zeros. `squares` gets the sum of the
 * squares of each row, for whoever wants to keep the norm.
 *
 * Index space: rows of the padded plane.
 *
 * Buffers: image[height, width, depth], fields[2 * FIELDS, rows, columns], squares[height]. */

#include "include/portable.h"

#ifndef CHANNELS
#define CHANNELS 3
#endif
#define FIELDS ((CHANNELS + 1) / 2)

KERNEL void fft_pack(
    __global const float *restrict image, __global float *restrict fields, __global float *restrict squares,
    int height, int width, int depth, int rows, int columns)
{
  const int y = (int)get_global_id(0);
  if (y >= rows) return;
  const long plane = (long)rows * columns;
  float sum = 0;
  for (int c = 0; c < 2 * FIELDS; c++) {
    __global float *restrict row = fields + (c % 2 * FIELDS + c / 2) * plane + (long)y * columns;
    const int filled = c < CHANNELS && y < height ? width : 0;
    for (int x = 0; x < filled; x++) {
      const float value = image[((long)y * width + x) * depth + c];
      row[x] = value;
      sum += value * value;
    }
    for (int x = filled; x < columns; x++) row[x] = 0;
  }
  if (y < height) squares[y] = sum;
}
