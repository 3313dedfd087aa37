/* Gradient of compositing splats with Hermite modes, tile by tile; driver for GPUs.
 *
 * What is computed is told in splat_raster_grad_cpu.cl. Index space: (tiles x GROUP): one group
 * works on one tile, each item on every GROUP-th of its pixels, as in splat_raster_grad_gpu.cl. The
 * numbers of a record are summed over the items ROUND at a time, each by one item in the order of
 * the items, so that the sum is the same in every run. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/hermite_edge.h"
#include "include/hermite_modes.h"
#include "include/hermite_alpha.h"
#include "include/hermite_slots.h"

#define PIXELS (TILE * TILE / GROUP)
#define ROUND (RECORD < 64 ? RECORD : 64)
/* Numbers that are to stay in registers need loops without turns; too many stay nowhere. */
#if RECORD <= 128
#define UNROLL_IF_FEW UNROLL
#else
#define UNROLL_IF_FEW
#endif

KERNEL void hermite_raster_grad_gpu(
    __global float *restrict slots, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict screen, __global const float *restrict modes,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts, int height,
    int width, int tiles_x, int first_tile_row, float cap)
{
  /* One more than GROUP in a row, so that items which sum neighbouring rows read other banks. */
  __local float shares[ROUND][GROUP + 1];
  __local int ends[GROUP];
  const int me = (int)get_local_id(0), tile = GROUP_NUMBER(0);
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  const float most = cap_that_counts(cap);
  float left[PIXELS], behind[PIXELS], v[PIXELS][CHANNELS];
  const int begin = starts[tile];
  int end[PIXELS], deepest = 0;
  for (int p = 0; p < PIXELS; p++) {
    const int within = p * GROUP + me, x = x0 + within % TILE, y = y0 + within / TILE;
    const int inside = x < width && y < height;
    const long pixel = inside ? (long)y * width + x : 0;
    left[p] = inside ? transmittance[pixel] : 1;
    end[p] = inside ? last[pixel] + begin : 0;
    behind[p] = inside ? grad_transmittance[pixel] : 0;
    for (int n = 0; n < CHANNELS; n++) {
      v[p][n] = inside ? grad_image[pixel * CHANNELS + n] : 0;
      behind[p] += v[p][n] * background[n];
    }
    deepest = end[p] > deepest ? end[p] : deepest;
  }
  ends[me] = deepest;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int n = 0; n < GROUP; n++) deepest = ends[n] > deepest ? ends[n] : deepest;
  for (int entry = starts[tile + 1] - 1; entry >= begin; entry--) {
    float sums[RECORD];
    UNROLL_IF_FEW for (int n = 0; n < RECORD; n++) sums[n] = 0;
    if (entry < deepest) {
      const int splat = entries[entry].x;
      __global const float *s = screen + 8 * splat;
      __global const float *feature = features + (long)splat * CHANNELS;
      __global const float *mode = modes + (long)splat * ROW;
      for (int p = 0; p < PIXELS; p++) {
        const int within = p * GROUP + me;
        const float dx = x0 + within % TILE + 0.5f - s[0], dy = y0 + within / TILE + 0.5f - s[1];
        const float u1 = mode[0] * dx, u2 = mode[1] * dx + mode[2] * dy;
        const float power = -(STRETCH * STRETCH) * (u1 * u1 + u2 * u2);
        if (!(power >= LEAST_POWER) || entry >= end[p]) continue;
        float he1[MOMENT_ORDER + 1], he2[MOMENT_ORDER + 1];
        hermite_values(he1, u1, MOMENT_ORDER);
        hermite_values(he2, u2, MOMENT_ORDER);
        const float shaped = polynomial_of_modes(1, mode + 3, 1, he1, he2, SHAPE_ORDER);
        const float g = s[5] * power_of_two(power);
        const float raw = density_that_counts((SQUARED ? shaped * shaped : shaped) * g, 1);
        float cv = 0;
        UNROLL_IF_FEW for (int n = 0; n < CHANNELS; n++)
          cv += v[p][n] * color_at(feature[n], mode, n, he1, he2);
#if ADDITIVE
        const float w = raw, h = g * cv;
#else
        if (!(raw > 0)) continue;
        const float hidden = hidden_by(raw), alpha = hidden < most ? hidden : most;
        const float t = left[p] / (1.0f - alpha), difference = cv - behind[p], w = alpha * t;
        left[p] = t;
        behind[p] += alpha * difference;
        float h = hidden <= most ? g * (t * difference) : 0;
        if (ACTIVATION != CLAMP) h *= 1.0f - hidden;
        if (SQUARED) h *= shaped;
#endif
        UNROLL for (int j = 0; j < SHAPE_ORDER + 3; j++)
          UNROLL for (int i = 0; i < SHAPE_ORDER + 3; i++)
            if (i + j < SHAPE_ORDER + 3) sums[MODE(i, j)] += h * he2[j] * he1[i];
        UNROLL_IF_FEW for (int n = 0; n < CHANNELS; n++) {
          const float wv = w * v[p][n];
          UNROLL for (int j = 0; j <= COLOR_ORDER; j++)
            UNROLL for (int i = 0; i <= COLOR_ORDER; i++)
              if (i + j <= (n < VARIED ? COLOR_ORDER : 0))
                sums[COLOR_MOMENT(i, j, n)] += wv * he2[j] * he1[i];
        }
      }
    }
    UNROLL_IF_FEW for (int first = 0; first < RECORD; first += ROUND) {
      UNROLL_IF_FEW for (int n = 0; n < ROUND; n++)
        if (first + n < RECORD) shares[n][me] = sums[first + n];
      barrier(CLK_LOCAL_MEM_FENCE);
      for (int n = me; n < ROUND && first + n < RECORD; n += GROUP) {
        float sum = 0;
        for (int item = 0; item < GROUP; item++) sum += shares[n][item];
        slots[(long)entries[entry].y * RECORD + first + n] = sum;
      }
      barrier(CLK_LOCAL_MEM_FENCE);
    }
  }
}
