/* Composite the splats of a tile front to back; driver for GPUs.
 *
 * What is computed is told in splat_raster_cpu.cl. Index space: (pixels, tile after tile, of the
 * rows of tiles from first_tile_row on), one work-item each. The items of a group lie in one tile and walk its list together, so that every
 * load of a splat is one broadcast; a group ends when its last pixel is finished. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"

KERNEL void splat_raster_gpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict screen,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts,
    int height, int width, int tiles_x, int first_tile_row, float cap, int stride, int first)
{
  const int item = (int)get_global_id(0);
  const int tile = item / (TILE * TILE), within = item % (TILE * TILE);
  const int x = tile % tiles_x * TILE + within % TILE, y = (tile / tiles_x + first_tile_row) * TILE + within / TILE;
  if (x >= width || y >= height) return;
  float left = 1, color[CHANNELS];
  int end = starts[tile + 1];
  UNROLL for (int n = 0; n < CHANNELS; n++) color[n] = 0;
  for (int entry = starts[tile]; entry < end; entry++) {
    const int splat = entries[entry].x;
    __global const float *s = screen + 8 * splat;
    __global const float *feature = features + (long)splat * stride + first;
    const float dx = s[0] - x - 0.5f, dy = s[1] - y - 0.5f;
    const float sigma = 0.5f * (s[2] * dx * dx + s[4] * dy * dy) + s[3] * dx * dy;
    float w = s[5] * falloff(TO_POWER * sigma);
#if !ADDITIVE
    const float alpha = SMOOTH || w < cap ? w : cap;
    if (!SMOOTH && alpha < ALPHA_THRESHOLD) continue;
    w = alpha * left;
    if (!SMOOTH && left - w <= TRANSMITTANCE_THRESHOLD) {
      end = entry;
      break;
    }
    left -= w;
#endif
    UNROLL for (int n = 0; n < CHANNELS; n++) color[n] += w * feature[n];
  }
  const long pixel = (long)y * width + x;
  transmittance[pixel] = left;
  last[pixel] = end - starts[tile];
  UNROLL for (int n = 0; n < CHANNELS; n++)
    image[pixel * stride + first + n] = color[n] + (ADDITIVE ? 0 : left * background[first + n]);
}
