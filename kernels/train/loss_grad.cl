/* The gradient of an image loss, and the sum of its pixelwise part.
 *
 * With x the image, y the target, m the weights (one where there are none) and n the number of
 * floats of y, the loss is the mean of m ((1 - w) |x - y| + w (1 - SSIM)); its gradient is
 *
 *     (1 - w)/n m sign(x - y) + w/n (E(m0) + (x - y) E(m1) + (x + y - 1) E(m2)),
 *
 * with the maps and the blur E of ssim_map.cl. In place of the magnitude stands PIXEL_LOSS, an
 * expression of d = x - y, and in place of its slope times m PIXEL_GRADIENT, one of d and m. Without
 * SSIM there are no maps and the second part is left out. The image may have more channels than the
 * target; the gradient is zero there.
 *
 * `parts` gets the sum of the first part over each item's floats, one number for each item from
 * `first_part` on. Index space: (strips of floats, runs of rows from `first_run` on), a group for each
 * tile. The maps hold `map_rows` rows of the image, from `map_first` on, and all that these tiles read.
 *
 * Buffers: image, grad[height, width / CHANNELS, IMAGE_CHANNELS], target[height, width],
 * weights[WEIGHTED ? height : 0, width / CHANNELS], maps[SSIM ? MAPS : 0, map_rows, pitch],
 * parts[first_part + (first_run + along1) * ((width + STRIP - 1) / STRIP) * GROUP]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/train/ssim_tile.h"

#ifndef SSIM
#define SSIM 1
#endif
#ifndef PIXEL_LOSS
#define PIXEL_LOSS absolute(d)
#define PIXEL_GRADIENT d > 0 ? m : d < 0 ? -m : 0
#endif

#define MAPS 3

static void store_grad(__global float *row, int f, int width, lanes g) {
  if (IMAGE_CHANNELS == CHANNELS && f + LANES <= width) {
    STORE(row + f, g);
    return;
  }
  const lanes_int place = image_places(f, width);
  for (int lane = 0; lane < LANES && f + lane < width; lane++) {
    const int at = ((const int *)&place)[lane];
    row[at] = ((const float *)&g)[lane];
    if ((f + lane) % CHANNELS == CHANNELS - 1)
      for (int k = 1; k <= IMAGE_CHANNELS - CHANNELS; k++) row[at + k] = 0;
  }
}

KERNEL void loss_grad(
    __global const float *restrict image, __global const float *restrict target,
    __global const float *restrict weights, __global const float *restrict maps,
    __global float *restrict grad, __global float *restrict parts, int first_part,
    int first_run, int map_first, int map_rows, int height, int width, int pitch,
    float pixel_scale, float ssim_scale)
{
  const int first = GROUP_NUMBER(0) * STRIP, row0 = (first_run + GROUP_NUMBER(1)) * ROWS;
  const int item = (int)get_local_id(0);
  const long image_width = (long)width / CHANNELS * IMAGE_CHANNELS;
#if SSIM
  __local float rows[MAPS][ROWS][SPAN];
  for (int n = item * LANES; n < SPAN; n += GROUP * LANES) {
    int f = first - HALO + n;
    if (f < 0 || f >= width) continue;
    f = f + LANES <= width ? f : width - LANES;
    UNROLL for (int map = 0; map < MAPS; map++) {
      lanes sums[ROWS];
      UNROLL for (int o = 0; o < ROWS; o++) sums[o] = 0;
      UNROLL for (int r = 0; r < ROWS + 2 * RADIUS; r++) {
        const long row = (long)map * map_rows - map_first + mirrored(row0 + r - RADIUS, height);
        add_row(sums, r, LOAD(maps + row * pitch + f));
      }
      UNROLL for (int o = 0; o < ROWS; o++) STORE_LOCAL(rows[map][o] + f - first + HALO, sums[o]);
    }
  }
  WAIT
  for (int k = 0; k < MAPS * ROWS; k++) mirror_ends(rows[k / ROWS][k % ROWS], first, width);
  WAIT
#endif
  lanes sum = 0;
  for (int o = 0; o < ROWS && row0 + o < height; o++)
    for (int n = item * LANES; n < STRIP && first + n < width; n += GROUP * LANES) {
      const int f = first + n;
      const long row = row0 + o;
      const lanes x = load_image(image + row * image_width, f, width);
      const lanes y = load_row(target + row * width, f, width);
      const lanes d = x - y;
      lanes m = pixel_scale;
#if WEIGHTED
      m = m * load_weights(weights + row * (width / CHANNELS), f, width);
#endif
      const lanes error = PIXEL_LOSS;
      lanes g = PIXEL_GRADIENT;
#if SSIM
      const lanes E0 = blurred_along(rows[0][o] + HALO + n);
      const lanes E1 = blurred_along(rows[1][o] + HALO + n);
      const lanes E2 = blurred_along(rows[2][o] + HALO + n);
      g = g + ssim_scale * (E0 + d * E1 + (x + y - 1) * E2);
#endif
      sum = sum + (f + LANE_NUMBERS < width ? m * error : 0);
      store_grad(grad + row * image_width, f, width, g);
    }
  const long tile = (long)(row0 / ROWS) * ((width + STRIP - 1) / STRIP) + first / STRIP;
  parts[first_part + tile * GROUP + item] = SUM_OF_LANES(sum);
}
