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
 * Index space: (tiles), of the rows of tiles from first_tile_row on. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/tile_pixels.h"
#include "include/splat_slots.h"
#include "include/transpose.h"

KERNEL void splat_raster_grad_cpu(
    __global float *restrict slots, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict screen, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row,
    float cap, int stride, int first)
{
  const int tile = (int)get_global_id(0), start = starts[tile];
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  /* Of each pixel: T on the way back, q, and v. */
  lanes state[PIXELS][2 + CHANNELS];
  lanes_int end[PIXELS];
  const int deepest = read_pixels(
      state, end, start, x0, y0, height, width, stride, first, background, grad_image,
      grad_transmittance, transmittance, last);
  for (int entry = deepest; entry < starts[tile + 1]; entry++)
    for (int n = 0; n < RECORD; n++)
      if (first == 0 || !SHARED(n)) slots[(long)entries[entry].y * RECORD_LENGTH + PLACE(n)] = 0;
  for (int entry = deepest - 1; entry >= start; entry--) {
    const int splat = entries[entry].x, next_splat = entries[entry - AHEAD > start ? entry - AHEAD : entry].x;
    PREFETCH(screen + 8 * next_splat);
    PREFETCH(features + (long)next_splat * stride + first);
    __global float *slot = slots + (long)entries[entry].y * RECORD_LENGTH;
    lanes sums[RECORD];
    UNROLL for (int n = 0; n < RECORD; n++) sums[n] = 0;
    __global const float *conic = screen + 8 * splat + 2;
    __global const float *feature = features + (long)splat * stride + first;
    const TileSplat s = splat_in_tile(screen + 8 * splat, x0, y0);
    for (int strip = 0; strip < STRIPS; strip++) {
      const float begin = strip * LANES + 0.5f;
      if (!reaches_strip(s, begin)) continue;
      const lanes dx = (s.x - begin) - LANE_NUMBERS;
      const lanes quadratic = s.a * dx * dx, linear = s.b * dx;
      lanes dy = s.y - (s.top + 0.5f);
      /* Sums over rows of dL/dsigma times 1, dy, dy^2; dx is the same in all rows. */
      lanes zeroth = 0, first_y = 0, second_y = 0;
      for (int row = s.top; row < s.bottom; row++) {
        const int p = strip * TILE + row;
        lanes *here = state[p];
        const lanes power = quadratic + dy * (linear + s.c * dy), raw = s.weight * falloff(power);
        lanes cv = 0;
        UNROLL for (int n = 0; n < CHANNELS; n++) cv = cv + feature[n] * here[2 + n];
#if ADDITIVE
        const lanes w = raw;
        lanes g = -raw * cv;
#else
        lanes alpha = raw;
#if !SMOOTH
        alpha = alpha < cap ? alpha : cap;
        alpha = alpha < ALPHA_THRESHOLD ? 0 : alpha;
        alpha = entry < end[p] ? alpha : 0;
#endif
        const lanes t = here[0] / (1.0f - alpha);
        const lanes difference = cv - here[1], w = alpha * t;
        here[0] = t;
        here[1] = here[1] + alpha * difference;
        lanes g = -w * difference;
#if !SMOOTH
        g = raw > cap ? 0 : g;
#endif
#endif
#if SMOOTH
        sums[0] = sums[0] + g;
        g = g * falloff_rate(power);
#endif
        zeroth = zeroth + g;
        first_y = first_y + g * dy;
        second_y = second_y + g * (dy * dy);
        UNROLL for (int n = 0; n < CHANNELS; n++) sums[6 + n] = sums[6 + n] + w * here[2 + n];
#if ABSGRAD
        sums[RECORD - 2] = sums[RECORD - 2] + absolute(g * (conic[0] * dx + conic[1] * dy));
        sums[RECORD - 1] = sums[RECORD - 1] + absolute(g * (conic[1] * dx + conic[2] * dy));
#endif
        dy = dy - 1.0f;
      }
#if !SMOOTH
      sums[0] = sums[0] + zeroth;
#endif
      sums[1] = sums[1] + zeroth * dx;
      sums[2] = sums[2] + first_y;
      sums[3] = sums[3] + zeroth * dx * dx;
      sums[4] = sums[4] + first_y * dx;
      sums[5] = sums[5] + second_y;
    }
    UNROLL for (int n = 0; n < RECORD; n++) {
      const float sum = SUM_OF_LANES(sums[n]);
      slot[PLACE(n)] = first > 0 && SHARED(n) ? slot[PLACE(n)] + sum : sum;
    }
  }
}
