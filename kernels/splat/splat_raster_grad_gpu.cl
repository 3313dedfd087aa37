/* Gradient of compositing, tile by tile; driver for GPUs.
 *
 * What is computed is told in splat_raster_grad_cpu.cl. Index space: (tiles x GROUP): one group
 * works on one tile, each item on every GROUP-th of its pixels. For BATCH splats at a time the
 * items put their shares of a slot's numbers into local memory; then each number is summed by one
 * item in the order of the items, so that the sum is the same in every run. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/alpha.h"
#include "include/splat_slots.h"

#define PIXELS (TILE * TILE / GROUP)
#ifndef BATCH
#define BATCH (RECORD <= 16 ? 4 : 1)
#endif

KERNEL void splat_raster_grad_gpu(
    __global float *restrict slots, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict screen, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row,
    float cap, int stride, int first)
{
  __local float shares[BATCH][RECORD][GROUP];
  __local int ends[GROUP];
  const int me = (int)get_local_id(0), tile = GROUP_NUMBER(0);
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
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
      v[p][n] = inside ? grad_image[pixel * stride + first + n] : 0;
      behind[p] += v[p][n] * background[first + n];
    }
    deepest = end[p] > deepest ? end[p] : deepest;
  }
  ends[me] = deepest;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int n = 0; n < GROUP; n++) deepest = ends[n] > deepest ? ends[n] : deepest;
  for (int top = starts[tile + 1]; top > begin; top -= BATCH) {
    for (int k = 0; k < BATCH; k++) {
      const int entry = top - 1 - k;
      float sums[RECORD];
      UNROLL for (int n = 0; n < RECORD; n++) sums[n] = 0;
      if (entry >= begin && entry < deepest) {
        const int splat = entries[entry].x;
        __global const float *s = screen + 8 * splat;
        __global const float *feature = features + (long)splat * stride + first;
        for (int p = 0; p < PIXELS; p++) {
          const int within = p * GROUP + me;
          const float dx = s[0] - (x0 + within % TILE) - 0.5f;
          const float dy = s[1] - (y0 + within / TILE) - 0.5f;
          const float sigma = 0.5f * (s[2] * dx * dx + s[4] * dy * dy) + s[3] * dx * dy;
          const float raw = s[5] * falloff(TO_POWER * sigma);
          float cv = 0;
          UNROLL for (int n = 0; n < CHANNELS; n++) cv += feature[n] * v[p][n];
#if ADDITIVE
          const float w = raw;
          float g = -raw * cv;
#else
          const float alpha = SMOOTH || raw < cap ? raw : cap;
          if (!SMOOTH && (alpha < ALPHA_THRESHOLD || entry >= end[p])) continue;
          const float t = left[p] / (1.0f - alpha), difference = cv - behind[p], w = alpha * t;
          left[p] = t;
          behind[p] += alpha * difference;
          float g = !SMOOTH && raw > cap ? 0 : -w * difference;
#endif
          sums[0] += g;
#if SMOOTH
          g *= falloff_rate(TO_POWER * sigma);
#endif
          sums[1] += g * dx;
          sums[2] += g * dy;
          sums[3] += g * dx * dx;
          sums[4] += g * dx * dy;
          sums[5] += g * dy * dy;
          UNROLL for (int n = 0; n < CHANNELS; n++) sums[6 + n] += w * v[p][n];
#if ABSGRAD
          sums[RECORD - 2] += fabs(g * (s[2] * dx + s[3] * dy));
          sums[RECORD - 1] += fabs(g * (s[3] * dx + s[4] * dy));
#endif
        }
      }
      UNROLL for (int n = 0; n < RECORD; n++) shares[k][n][me] = sums[n];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int n = me; n < BATCH * RECORD; n += GROUP) {
      const int k = n / RECORD, entry = top - 1 - k;
      float sum = 0;
      for (int item = 0; item < GROUP; item++) sum += shares[k][n % RECORD][item];
      if (entry < begin) continue;
      __global float *slot = slots + (long)entries[entry].y * RECORD_LENGTH;
      const int place = PLACE(n % RECORD);
      slot[place] = first > 0 && SHARED(n % RECORD) ? slot[place] + sum : sum;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
