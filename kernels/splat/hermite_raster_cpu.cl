/* Composite splats with Hermite modes, front to back; driver for CPUs.
 *
 *     light: C = sum of w color(u') + T background,  w = alpha T,  T the product of (1 - alpha);
 *     ADDITIVE: C = sum of weight Q(u') exp(-|u'|^2 / 2) color(u'), signed, whatever the order.
 *
 * Polynomials and the place u' are told in include/hermite_modes.h, alpha in
 * include/hermite_alpha.h; tiles, strips, the state of a pixel and when work stops are those of
 * splat_raster_cpu.cl. A splat's polynomials are turned into powers once per tile and into
 * polynomials of a single variable once per strip, where each lane has its u1; a row then costs a
 * Gaussian, and one multiply-add for each order and each polynomial.
 *
 * A pixel has CHANNELS channels, of which the first VARIED have a polynomial. Written for each
 * pixel: image (CHANNELS numbers), the final transmittance, and how many of the tile's entries
 * were looked at. Index space: (tiles), of the rows of tiles from first_tile_row on. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/tile_pixels.h"
#include "include/hermite_edge.h"
#include "include/hermite_modes.h"
#include "include/hermite_alpha.h"

KERNEL void hermite_raster_cpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict screen,
    __global const float *restrict modes, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row,
    float cap)
{
  const int tile = (int)get_global_id(0), start = starts[tile], stop = starts[tile + 1];
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  const float most = cap_that_counts(cap);
  lanes state[PIXELS][1 + CHANNELS];
  lanes_int end[PIXELS];
  clear_pixels(state, end, stop);
  for (int entry = start; entry < stop; entry++) {
    const int splat = entries[entry].x;
    const int next_splat = entries[entry + AHEAD < stop ? entry + AHEAD : entry].x;
    PREFETCH(screen + 8 * next_splat);
    PREFETCH(modes + (long)next_splat * ROW);
    PREFETCH(features + (long)next_splat * CHANNELS);
    __global const float *feature = features + (long)splat * CHANNELS;
    __global const float *mode = modes + (long)splat * ROW;
    const TileSplat s = splat_in_tile(screen + 8 * splat, x0, y0);
#if !ADDITIVE && !SMOOTH
    if ((entry - start) % PATIENCE == PATIENCE - 1 && all_negative(state)) break;
#endif
    float shape[MODES(SHAPE_ORDER)], color[VARIED + 1][MODES(COLOR_ORDER)];
    turn_into_powers(shape, 1, mode + 3, 1, SHAPE_ORDER);
    if (!SQUARED) {
      UNROLL for (int m = 0; m < MODES(SHAPE_ORDER); m++) shape[m] *= s.weight;
    }
    UNROLL for (int n = 0; n < VARIED; n++)
      turn_into_powers(color[n], feature[n], mode + COLOR_MODES + n, COLORED, COLOR_ORDER);
    for (int strip = 0; strip < STRIPS; strip++) {
      const float begin = strip * LANES + 0.5f;
      if (!reaches_strip(s, begin)) continue;
      const lanes dx = (begin - s.x) + LANE_NUMBERS, far = mode[0] * dx;
      const lanes quadratic = -(STRETCH * far) * (STRETCH * far), linear = STRETCH * mode[1] * dx;
      const float slope = STRETCH * mode[2];
      lanes he[ORDER + 1], q[SHAPE_ORDER + 1], column[VARIED + 1][COLOR_ORDER + 1];
      hermite_values(he, absolute(far) < REACH ? far : 0, ORDER);
      polynomial_of_column(q, shape, he, SHAPE_ORDER);
      UNROLL for (int n = 0; n < VARIED; n++)
        polynomial_of_column(column[n], color[n], he, COLOR_ORDER);
      lanes dy = (s.top + 0.5f) - s.y;
      lanes_int turned = 0;
      for (int row = s.top; row < s.bottom; row++) {
        lanes *here = state[strip * TILE + row];
        const lanes place = linear + slope * dy, power = quadratic - place * place;
        const lanes_int within = power >= LEAST_POWER;
        const lanes v = within ? place : 0, shaped = polynomial_at(q, v, SHAPE_ORDER);
        const lanes g = power_of_two(power);
        const lanes density = SQUARED ? shaped * shaped * (s.weight * g) : shaped * g;
        const lanes raw = density_that_counts(density, within);
        dy = dy + 1.0f;
#if ADDITIVE
        const lanes w = raw;
#else
        const lanes hidden = hidden_by(raw), alpha = hidden < most ? hidden : most;
#if SMOOTH
        const lanes w = alpha * here[0];
        here[0] = here[0] - w;
#else
        const lanes t = here[0], share = alpha * t, rest = t - share;
        const lanes_int goes_on = rest > TRANSMITTANCE_THRESHOLD;
        const lanes w = goes_on ? share : 0;
        const lanes after = goes_on ? rest : AS_LANES(AS_INT(t) | SIGN_BIT);
        turned |= AS_INT(t) ^ AS_INT(after);
        here[0] = after;
#endif
#endif
        UNROLL for (int n = 0; n < CHANNELS; n++) {
          const lanes seen = n < VARIED ? polynomial_at(column[n], v, COLOR_ORDER) : feature[n];
          here[1 + n] = here[1 + n] + w * seen;
        }
      }
      if (any_negative(turned)) note_finished(state, end, strip, s, stop, entry);
    }
  }
  write_pixels(
      state, end, start, x0, y0, height, width, CHANNELS, 0, background, image, transmittance, last);
}
