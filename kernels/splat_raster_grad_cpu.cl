/* Gradient of compositing, tile by tile; driver for CPUs.
 *
 * With v = dL/dC and u = dL/d(final transmittance) of a pixel, whose last entry is known from the
 * way forward, go back to front. Let q be the colour that lies behind a splat, seen through v:
 * q = v . background + u behind the last one, then q' = alpha (c . v) + (1 - alpha) q. So
 *
 *     T = T' / (1 - alpha),    dL/dalpha = T (c . v - q),    dL/dc = alpha T v,
 *     dL/dsigma = -alpha dL/dalpha    (zero where alpha was capped).
 *
 * No sum is ever taken back, so the deepest splats keep their digits. A forward sweep would need
 * what remains of C after each splat, a difference of nearly equal numbers.
 *
 * Each (splat, tile) pair owns a slot, which this kernel writes once, in a fixed order of sums; see
 * include/splat_slots.h for its record.
 *
 * Index space: (tiles). */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/splat.h"
#include "include/splat_slots.h"
#include "include/transpose.h"

#define STRIPS (TILE / LANES)
#define PIXELS (STRIPS * TILE)

KERNEL void splat_raster_grad_cpu(
    __global float *restrict slots, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict screen, __global const int2 *restrict radii,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts,
    int height, int width, int tiles_x, float cap, int stride, int first)
{
  const int tile = (int)get_global_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  lanes left[PIXELS], behind[PIXELS], v[CHANNELS][PIXELS];
  lanes_int end[PIXELS];
  int deepest = 0;
  for (int p = 0; p < PIXELS; p++) {
    const int y = y0 + p % TILE, x = x0 + p / TILE * LANES;
    for (int lane = 0; lane < LANES; lane++) {
      const int inside = x + lane < width && y < height;
      const long pixel = inside ? (long)y * width + x + lane : 0;
      float q = inside ? grad_transmittance[pixel] : 0;
      for (int n = 0; n < CHANNELS; n++) {
        const float g = inside ? grad_image[pixel * stride + first + n] : 0;
        ((float *)&v[n][p])[lane] = g;
        q += g * background[first + n];
      }
      const int stop = inside ? last[pixel] : 0;
      ((float *)&left[p])[lane] = inside ? transmittance[pixel] : 1;
      ((float *)&behind[p])[lane] = q;
      ((int *)&end[p])[lane] = stop;
      deepest = stop > deepest ? stop : deepest;
    }
  }
  for (int entry = starts[tile + 1] - 1; entry >= starts[tile]; entry--) {
    const int splat = entries[entry].x;
    __global float *slot = slots + (long)entries[entry].y * RECORD_LENGTH;
    lanes sums[RECORD];
    UNROLL for (int n = 0; n < RECORD; n++) sums[n] = 0;
    if (ADDITIVE || entry < deepest) {
      __global const float *s = screen + 8 * splat;
      __global const float *feature = features + (long)splat * stride + first;
      const float mean_x = s[0], mean_y = s[1], weight = s[5];
      const float a = 0.5f * s[2], b = s[3], c = 0.5f * s[4];
      const int2 radius = radii[splat];
      const int row0 = (int)(mean_y - radius.y) - 1 - y0, row1 = (int)(mean_y + radius.y) + 1 - y0;
      const int top = row0 > 0 ? row0 : 0, bottom = row1 < TILE ? row1 : TILE;
      for (int strip = 0; strip < STRIPS; strip++) {
        const float left_edge = (float)(x0 + strip * LANES);
        if (left_edge > mean_x + radius.x || left_edge + LANES < mean_x - radius.x) continue;
        const lanes dx = (mean_x - left_edge - 0.5f) - LANE_NUMBERS;
        const lanes quadratic = a * dx * dx, linear = b * dx;
        /* Sums over rows of dL/dsigma times 1, dy, dy^2; dx is the same in all rows. */
        lanes zeroth = 0, first_y = 0, second_y = 0;
        for (int row = top; row < bottom; row++) {
          const int p = strip * TILE + row;
          const float dy = mean_y - (float)(y0 + row) - 0.5f;
          const lanes sigma = quadratic + linear * dy + c * dy * dy;
          lanes cv = 0;
          UNROLL for (int n = 0; n < CHANNELS; n++) cv = cv + feature[n] * v[n][p];
          const lanes raw = weight * falloff(sigma);
#if ADDITIVE
          const lanes w = raw;
          lanes g = -raw * cv;
#else
          lanes alpha = raw;
#if !SMOOTH
          alpha = alpha < cap ? alpha : cap;
          alpha = alpha < FAINTEST ? 0 : alpha;
          alpha = sigma < 0 ? 0 : alpha;
          alpha = entry < end[p] ? alpha : 0;
#endif
          const lanes t = left[p] / (1.0f - alpha);
          const lanes difference = cv - behind[p], w = alpha * t;
          left[p] = t;
          behind[p] = behind[p] + alpha * difference;
          lanes g = -w * difference;
#if !SMOOTH
          g = raw > cap ? 0 : g;
#endif
#endif
          sums[0] = sums[0] + g;
          g = g * falloff_rate(sigma);
          zeroth = zeroth + g;
          first_y = first_y + g * dy;
          second_y = second_y + g * (dy * dy);
          UNROLL for (int n = 0; n < CHANNELS; n++) sums[6 + n] = sums[6 + n] + w * v[n][p];
#if ABSGRAD
          sums[RECORD - 2] = sums[RECORD - 2] + absolute(g * (2.0f * a * dx + b * dy));
          sums[RECORD - 1] = sums[RECORD - 1] + absolute(g * (b * dx + 2.0f * c * dy));
#endif
        }
        sums[1] = sums[1] + zeroth * dx;
        sums[2] = sums[2] + first_y;
        sums[3] = sums[3] + zeroth * dx * dx;
        sums[4] = sums[4] + first_y * dx;
        sums[5] = sums[5] + second_y;
      }
    }
    UNROLL for (int n = 0; n < RECORD; n++) {
      const float sum = SUM_OF_LANES(sums[n]);
      slot[PLACE(n)] = first > 0 && SHARED(n) ? slot[PLACE(n)] + sum : sum;
    }
  }
}
