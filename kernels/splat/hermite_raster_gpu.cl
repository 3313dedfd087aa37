/* Composite splats with Hermite modes, front to back; driver for GPUs.
 *
 * What is computed is told in splat_raster_cpu.cl. Index space: (pixels, tile after tile, of the
 * rows of tiles from first_tile_row on), one work-item each, as in splat_raster_gpu.cl. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/hermite_edge.h"
#include "include/hermite_modes.h"
#include "include/hermite_alpha.h"

KERNEL void hermite_raster_gpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict screen,
    __global const float *restrict modes, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row,
    float cap)
{
  const int item = (int)get_global_id(0);
  const int tile = item / (TILE * TILE), within = item % (TILE * TILE);
  const int x = tile % tiles_x * TILE + within % TILE;
  const int y = (tile / tiles_x + first_tile_row) * TILE + within / TILE;
  if (x >= width || y >= height) return;
  const float most = cap_that_counts(cap);
  float left = 1, color[CHANNELS];
  int end = starts[tile + 1];
  UNROLL for (int n = 0; n < CHANNELS; n++) color[n] = 0;
  for (int entry = starts[tile]; entry < end; entry++) {
    const int splat = entries[entry].x;
    __global const float *s = screen + 8 * splat;
    __global const float *feature = features + (long)splat * CHANNELS;
    __global const float *mode = modes + (long)splat * ROW;
    const float dx = x + 0.5f - s[0], dy = y + 0.5f - s[1];
    const float u1 = mode[0] * dx, u2 = mode[1] * dx + mode[2] * dy;
    const float power = -(STRETCH * STRETCH) * (u1 * u1 + u2 * u2);
    if (!(power >= LEAST_POWER)) continue;
    float he1[ORDER + 1], he2[ORDER + 1];
    hermite_values(he1, u1, ORDER);
    hermite_values(he2, u2, ORDER);
    const float shaped = polynomial_of_modes(1, mode + 3, 1, he1, he2, SHAPE_ORDER);
    const float g = s[5] * power_of_two(power);
    float w = density_that_counts((SQUARED ? shaped * shaped : shaped) * g, 1);
#if !ADDITIVE
    const float hidden = hidden_by(w), alpha = hidden < most ? hidden : most;
    if (!SMOOTH && !(alpha > 0)) continue;
    w = alpha * left;
    if (!SMOOTH && left - w <= TRANSMITTANCE_THRESHOLD) {
      end = entry;
      break;
    }
    left -= w;
#endif
    UNROLL for (int n = 0; n < CHANNELS; n++)
      color[n] += w * color_at(feature[n], mode, n, he1, he2);
  }
  const long pixel = (long)y * width + x;
  transmittance[pixel] = left;
  last[pixel] = end - starts[tile];
  UNROLL for (int n = 0; n < CHANNELS; n++)
    image[pixel * CHANNELS + n] = color[n] + (ADDITIVE ? 0 : left * background[n]);
}
