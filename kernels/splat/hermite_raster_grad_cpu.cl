/* Gradient of compositing splats with Hermite modes, tile by tile; driver for CPUs.
 *
 * Back to front, as in splat_raster_grad_cpu.cl, with the splat's colour c(u') at each pixel:
 *
 *     T = T' / (1 - alpha),    dL/dalpha = T (c . v - q),    q' = q + alpha (c . v - q),
 *     dL/dE = dL/dalpha dalpha/dE,  zero where E does not count or alpha is capped.
 *
 * What a (splat, tile) pair leaves are moments, see include/hermite_slots.h. Within a strip they
 * are sums over rows of h v^k and w v_c v^k, with v = STRETCH u2; He~_i(u1), the same in all rows,
 * comes in once per strip, and powers are turned into Hermite polynomials once per tile.
 *
 * Index space: (tiles), of the rows of tiles from first_tile_row on. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/tile_pixels.h"
#include "include/transpose.h"
#include "include/hermite_edge.h"
#include "include/hermite_modes.h"
#include "include/hermite_alpha.h"
#include "include/hermite_slots.h"

#define PADDED ((RECORD + LANES - 1) / LANES * LANES)

KERNEL void hermite_raster_grad_cpu(
    __global float *restrict slots, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict screen, __global const float *restrict modes,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts, int height,
    int width, int tiles_x, int first_tile_row, float cap)
{
  const int tile = (int)get_global_id(0), start = starts[tile];
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  const float most = cap_that_counts(cap);
  /* Of each pixel: T on the way back, q, and v. */
  lanes state[PIXELS][2 + CHANNELS];
  lanes_int end[PIXELS];
  const int deepest = read_pixels(
      state, end, start, x0, y0, height, width, CHANNELS, 0, background, grad_image,
      grad_transmittance, transmittance, last);
  for (int entry = deepest; entry < starts[tile + 1]; entry++)
    for (int n = 0; n < RECORD; n++) slots[(long)entries[entry].y * RECORD + n] = 0;
  for (int entry = deepest - 1; entry >= start; entry--) {
    const int splat = entries[entry].x;
    const int next_splat = entries[entry - AHEAD > start ? entry - AHEAD : entry].x;
    PREFETCH(screen + 8 * next_splat);
    PREFETCH(modes + (long)next_splat * ROW);
    PREFETCH(features + (long)next_splat * CHANNELS);
    __global const float *feature = features + (long)splat * CHANNELS;
    __global const float *mode = modes + (long)splat * ROW;
    const TileSplat s = splat_in_tile(screen + 8 * splat, x0, y0);
    float shape[MODES(SHAPE_ORDER)], color[VARIED + 1][MODES(COLOR_ORDER)];
    turn_into_powers(shape, 1, mode + 3, 1, SHAPE_ORDER);
    if (!SQUARED) {
      UNROLL for (int m = 0; m < MODES(SHAPE_ORDER); m++) shape[m] *= s.weight;
    }
    UNROLL for (int n = 0; n < VARIED; n++)
      turn_into_powers(color[n], feature[n], mode + COLOR_MODES + n, COLORED, COLOR_ORDER);
    lanes sums[PADDED];
    UNROLL for (int n = 0; n < PADDED; n++) sums[n] = 0;
    for (int strip = 0; strip < STRIPS; strip++) {
      const float begin = strip * LANES + 0.5f;
      if (!reaches_strip(s, begin)) continue;
      const lanes dx = (begin - s.x) + LANE_NUMBERS, far = mode[0] * dx;
      const lanes quadratic = -(STRETCH * far) * (STRETCH * far), linear = STRETCH * mode[1] * dx;
      const float slope = STRETCH * mode[2];
      lanes he[MOMENT_ORDER + 1], q[SHAPE_ORDER + 1], column[VARIED + 1][COLOR_ORDER + 1];
      hermite_values(he, absolute(far) < REACH ? far : 0, MOMENT_ORDER);
      polynomial_of_column(q, shape, he, SHAPE_ORDER);
      UNROLL for (int n = 0; n < VARIED; n++)
        polynomial_of_column(column[n], color[n], he, COLOR_ORDER);
      lanes dy = (s.top + 0.5f) - s.y;
      /* Sums over rows of h v^k, and of w v_c v^k. */
      lanes of_shape[SHAPE_ORDER + 3], of_color[CHANNELS][COLOR_ORDER + 1];
      UNROLL for (int k = 0; k < SHAPE_ORDER + 3; k++) of_shape[k] = 0;
      UNROLL for (int n = 0; n < CHANNELS; n++)
        UNROLL for (int k = 0; k <= COLOR_ORDER; k++) of_color[n][k] = 0;
      for (int row = s.top; row < s.bottom; row++) {
        const int p = strip * TILE + row;
        lanes *here = state[p];
        const lanes place = linear + slope * dy, power = quadratic - place * place;
        const lanes_int within = power >= LEAST_POWER;
        const lanes v = within ? place : 0, shaped = polynomial_at(q, v, SHAPE_ORDER);
        lanes g = power_of_two(power);
        const lanes density = SQUARED ? shaped * shaped * (s.weight * g) : shaped * g;
        lanes raw = density_that_counts(density, within);
        dy = dy + 1.0f;
        lanes cv = 0;
        UNROLL for (int n = 0; n < CHANNELS; n++) {
          const lanes seen = n < VARIED ? polynomial_at(column[n], v, COLOR_ORDER) : feature[n];
          cv = cv + seen * here[2 + n];
        }
#if ADDITIVE
        const lanes w = raw, h = within ? g * cv : 0;
#else
        if (!SMOOTH) raw = entry < end[p] ? raw : 0;
        const lanes hidden = hidden_by(raw), alpha = hidden < most ? hidden : most;
        const lanes t = here[0] / (1.0f - alpha);
        const lanes difference = cv - here[1], w = alpha * t;
        here[0] = t;
        here[1] = here[1] + alpha * difference;
        g = ((raw > 0) & (hidden <= most)) ? g : 0;
        if (ACTIVATION != CLAMP) g = g * (1.0f - hidden);
        if (SQUARED) g = g * shaped;
        const lanes h = g * (t * difference);
#endif
        lanes powers[MOMENT_ORDER + 1];
        powers[1] = v;
        UNROLL for (int k = 2; k <= MOMENT_ORDER; k++)
          powers[k] = powers[k / 2] * powers[k - k / 2];
        of_shape[0] = of_shape[0] + h;
        UNROLL for (int k = 1; k < SHAPE_ORDER + 3; k++) of_shape[k] = of_shape[k] + h * powers[k];
        UNROLL for (int n = 0; n < CHANNELS; n++) {
          of_color[n][0] = of_color[n][0] + w * here[2 + n];
          const lanes wv = n < VARIED ? w * here[2 + n] : 0;
          UNROLL for (int k = 1; k <= COLOR_ORDER; k++)
            if (n < VARIED) of_color[n][k] = of_color[n][k] + wv * powers[k];
        }
      }
      UNROLL for (int i = 0; i < SHAPE_ORDER + 3; i++)
        UNROLL for (int k = 0; k < SHAPE_ORDER + 3; k++)
          if (i + k < SHAPE_ORDER + 3) sums[MODE(i, k)] = sums[MODE(i, k)] + he[i] * of_shape[k];
      UNROLL for (int n = 0; n < CHANNELS; n++)
        UNROLL for (int i = 0; i <= COLOR_ORDER; i++)
          UNROLL for (int k = 0; k <= COLOR_ORDER; k++)
            if (i + k <= (n < VARIED ? COLOR_ORDER : 0))
              sums[COLOR_MOMENT(i, k, n)] = sums[COLOR_MOMENT(i, k, n)] + he[i] * of_color[n][k];
    }
    lanes shares[PADDED / LANES];
    UNROLL for (int n = 0; n < PADDED; n += LANES) {
      TRANSPOSE(sums + n)
      shares[n / LANES] = sums[n];
      UNROLL for (int m = 1; m < LANES; m++) shares[n / LANES] = shares[n / LANES] + sums[n + m];
    }
    const float *totals = (const float *)shares;
    __global float *slot = slots + (long)entries[entry].y * RECORD;
    UNROLL for (int i = 0; i < SHAPE_ORDER + 3; i++)
      UNROLL for (int j = 0; j < SHAPE_ORDER + 3; j++) {
        if (i + j >= SHAPE_ORDER + 3) continue;
        float sum = 0;
        UNROLL for (int down = 0; down < SHAPE_ORDER + 3; down += 2)
          if (down <= j) sum += IN_POWERS[j][j - down] * totals[MODE(i, j - down)];
        slot[MODE(i, j)] = s.weight * sum;
      }
    UNROLL for (int n = 0; n < CHANNELS; n++)
      UNROLL for (int i = 0; i <= COLOR_ORDER; i++)
        UNROLL for (int j = 0; j <= COLOR_ORDER; j++) {
          if (i + j > (n < VARIED ? COLOR_ORDER : 0)) continue;
          float sum = 0;
          UNROLL for (int down = 0; down <= COLOR_ORDER; down += 2)
            if (down <= j) sum += IN_POWERS[j][j - down] * totals[COLOR_MOMENT(i, j - down, n)];
          slot[COLOR_MOMENT(i, j, n)] = sum;
        }
  }
}
