/* Composite the splats of a tile front to back; driver for CPUs (see include/alpha.h).
 *
 *     light: C = sum of w c + T background,  w = alpha T,  T the product of (1 - alpha) so far;
 *     ADDITIVE: C = sum of weight exp(-sigma) c, whatever the order (line integrals of X-rays).
 *
 * Index space: (tiles), of the rows of tiles from first_tile_row on. Each item owns one tile, whose
 * pixels lie in strips of LANES columns. For each splat only the strips and rows that its extents
 * touch are visited; strips are fixed, so that every load and store of a pixel's state is aligned
 * to where it was stored. A finished pixel keeps its transmittance with the sign turned, which
 * makes every later weight negative or zero and is dropped with it. Where a pixel finished is
 * noted only when a sign turned. Work stops when all pixels are finished.
 *
 * A pixel and a splat have `stride` channels, of which this launch does CHANNELS from `first`.
 * Written for each pixel: image (CHANNELS numbers), the final transmittance, and how
 * many of the tile's entries were looked at, where the gradient begins its way back. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/tile_pixels.h"

KERNEL void splat_raster_cpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict screen,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts,
    int height, int width, int tiles_x, int first_tile_row, float cap, int stride, int first)
{
  const int tile = (int)get_global_id(0), start = starts[tile], stop = starts[tile + 1];
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  lanes state[PIXELS][1 + CHANNELS];
  lanes_int end[PIXELS];
  clear_pixels(state, end, stop);
  for (int entry = start; entry < stop; entry++) {
    const int splat = entries[entry].x, next_splat = entries[entry + AHEAD < stop ? entry + AHEAD : entry].x;
    PREFETCH(screen + 8 * next_splat);
    PREFETCH(features + (long)next_splat * stride + first);
    __global const float *feature = features + (long)splat * stride + first;
    const TileSplat s = splat_in_tile(screen + 8 * splat, x0, y0);
#if !ADDITIVE && !SMOOTH
    if ((entry - start) % PATIENCE == PATIENCE - 1 && all_negative(state)) break;
#endif
    for (int strip = 0; strip < STRIPS; strip++) {
      const float begin = strip * LANES + 0.5f;
      if (!reaches_strip(s, begin)) continue;
      const lanes dx = (s.x - begin) - LANE_NUMBERS;
      const lanes quadratic = s.a * dx * dx, linear = s.b * dx;
      lanes dy = s.y - (s.top + 0.5f);
      lanes_int turned = 0;
      for (int row = s.top; row < s.bottom; row++) {
        lanes *here = state[strip * TILE + row];
        const lanes raw = s.weight * falloff(quadratic + dy * (linear + s.c * dy));
        dy = dy - 1.0f;
#if ADDITIVE
        const lanes w = raw;
#elif SMOOTH
        const lanes w = raw * here[0];
        here[0] = here[0] - w;
#else
        lanes alpha = raw < cap ? raw : cap;
        alpha = alpha < ALPHA_THRESHOLD ? 0 : alpha;
        const lanes t = here[0], share = alpha * t, rest = t - share;
        const lanes_int goes_on = rest > TRANSMITTANCE_THRESHOLD;
        const lanes w = goes_on ? share : 0, after = goes_on ? rest : AS_LANES(AS_INT(t) | SIGN_BIT);
        turned |= AS_INT(t) ^ AS_INT(after);
        here[0] = after;
#endif
        UNROLL for (int n = 0; n < CHANNELS; n++) here[1 + n] = here[1 + n] + w * feature[n];
      }
      if (any_negative(turned)) note_finished(state, end, strip, s, stop, entry);
    }
  }
  write_pixels(
      state, end, start, x0, y0, height, width, stride, first, background, image, transmittance, last);
}
