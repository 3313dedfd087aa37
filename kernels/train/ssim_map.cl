/* SSIM at every pixel, and what its gradient is blurred from.
 *
 * With E the blur (include/train/ssim_tile.h) and, for images x and y, d = x - y and p = x + y,
 *
 *     D = E(d),  P = E(p),  Vd = E(d d) - D^2,  Vp = E(p p) - P^2,
 *     M = (P^2 + D^2) / 2 + C1,   V = (Vp + Vd) / 2 + C2,   a = D^2 / M,   b = Vd / V,
 *
 * 2 mu1 mu2 = (P^2 - D^2) / 2, mu1^2 + mu2^2 = (P^2 + D^2) / 2 and likewise for the variances, so
 * luminance is 1 - a, contrast 1 - b, and SSIM = (1 - a)(1 - b): four blurs in place of five, and
 * exactly one where the images are the same. A variance does not change with p's origin: p - 1 is
 * blurred, being smaller. With e = 1 - SSIM,
 *
 *     de/dD = (1 - b) (2 - a) D / M,     de/dVd = (1 - a) (1 - b / 2) / V,
 *     de/dP = -(1 - b) a P / M,          de/dVp = -(1 - a) b / (2 V).
 *
 * E is its own adjoint, and the mean takes part in the variance: the sum of m e changes with x by
 *
 *     E(m0) + d E(m1) + p E(m2),
 *     m1 = 2 m de/dVd,  m2 = 2 m de/dVp,  m0 = m (de/dD + de/dP) - D m1 - P m2,
 *
 * with P and p of the shifted sum alike in the last line. Those three maps are written, planes of
 * `pitch` floats a row, and the sum of scale m e of the items, one number each. m is one where
 * there are no weights. Index space: (strips of floats, runs of rows from `first_run` on), a group
 * for each tile. The maps hold `map_rows` rows of the image, from `map_first` on.
 *
 * Buffers: image[height, width / CHANNELS, IMAGE_CHANNELS], target[height, width],
 * weights[WEIGHTED ? height : 0, width / CHANNELS], maps[3, map_rows, pitch],
 * parts[first_run + along1, (width + STRIP - 1) / STRIP, GROUP]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/train/ssim_tile.h"

#define C1 1e-4f
#define C2 9e-4f
#define MOMENTS 4

KERNEL void ssim_map(
    __global const float *restrict image, __global const float *restrict target,
    __global const float *restrict weights, __global float *restrict maps,
    __global float *restrict parts, int first_run, int map_first, int map_rows, int height,
    int width, int pitch, float scale)
{
  __local float rows[MOMENTS][ROWS][SPAN];
  const int first = GROUP_NUMBER(0) * STRIP, row0 = (first_run + GROUP_NUMBER(1)) * ROWS;
  const int item = (int)get_local_id(0);
  const long image_width = (long)width / CHANNELS * IMAGE_CHANNELS;
  for (int n = item * LANES; n < SPAN; n += GROUP * LANES) {
    int f = first - HALO + n;
    if (f < 0 || f >= width) continue;
    f = f + LANES <= width ? f : width - LANES;
    const lanes_int at = image_places(f, width);
    UNROLL for (int part = 0; part < 2; part++) {
      lanes mean[ROWS], square[ROWS];
      UNROLL for (int o = 0; o < ROWS; o++) mean[o] = square[o] = 0;
      UNROLL for (int r = 0; r < ROWS + 2 * RADIUS; r++) {
        const long row = mirrored(row0 + r - RADIUS, height);
        __global const float *in = image + row * image_width;
        const lanes x = IMAGE_CHANNELS == CHANNELS ? LOAD(in + f) : GATHER(in, at);
        const lanes y = LOAD(target + row * width + f);
        const lanes v = part ? x + y - 1 : x - y;
        add_row(mean, r, v);
        add_row(square, r, v * v);
      }
      UNROLL for (int o = 0; o < ROWS; o++) {
        STORE_LOCAL(rows[part][o] + f - first + HALO, mean[o]);
        STORE_LOCAL(rows[part + 2][o] + f - first + HALO, square[o]);
      }
    }
  }
  WAIT
  for (int k = 0; k < MOMENTS * ROWS; k++) mirror_ends(rows[k / ROWS][k % ROWS], first, width);
  WAIT
  lanes sum = 0;
  for (int o = 0; o < ROWS && row0 + o < height; o++)
    for (int n = item * LANES; n < STRIP && first + n < width; n += GROUP * LANES) {
      const int f = first + n;
      const lanes D = blurred_along(rows[0][o] + HALO + n);
      const lanes P = blurred_along(rows[1][o] + HALO + n);
      const lanes Vd = blurred_along(rows[2][o] + HALO + n) - D * D;
      const lanes Vp = blurred_along(rows[3][o] + HALO + n) - P * P;
      const lanes square = (P + 1) * (P + 1);
      const lanes M = 1 / (0.5f * (square + D * D) + C1), V = 1 / (0.5f * (Vp + Vd) + C2);
      const lanes a = D * D * M, b = Vd * V;
      lanes m = 1;
#if WEIGHTED
      m = load_weights(weights + (long)(row0 + o) * (width / CHANNELS), f, width);
#endif
      const lanes m1 = 2 * m * (1 - a) * (1 - 0.5f * b) * V, m2 = -m * (1 - a) * b * V;
      const lanes m0 = m * (1 - b) * M * ((2 - a) * D - a * (P + 1)) - D * m1 - P * m2;
      __global float *out = maps + (long)(row0 + o - map_first) * pitch + f;
      const long plane = (long)map_rows * pitch;
      STORE(out, m0);
      STORE(out + plane, m1);
      STORE(out + 2 * plane, m2);
      const lanes e = m * (a + b - a * b);
      sum = sum + (f + LANE_NUMBERS < width ? e : 0);
    }
  const long tile = (long)(row0 / ROWS) * ((width + STRIP - 1) / STRIP) + first / STRIP;
  parts[tile * GROUP + item] = scale * SUM_OF_LANES(sum);
}
