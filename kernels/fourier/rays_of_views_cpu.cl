/* Views become rays of the image's spectrum, BLOCK pairs of views at a time, for CPUs.
 *
 * What a GPU does by rays_pack_gpu, fft_pass and rays_weigh_gpu, all in the caches of a core (see
 * include/fourier/view_columns.h). Index space: items, each of which takes every so many-th
 * block.
 *
 * Buffers: views[count, slices, bins], rays[2, count, samples], order, starts[count], offsets[2 * columns],
 * shadows[2, 2 * columns], signs[2 * columns], bin_response[samples], ends[count],
 * scratch[items, 4, length, BLOCK], turns[length, 2]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/turn.h"
#include "include/fourier/ray_response.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/view_columns.h"
#include "include/fourier/fft_block.h"

KERNEL void rays_of_views_cpu(
    __global const float *restrict views, __global float *restrict rays,
    __global const int *restrict order, __global const int *restrict starts,
    __global const uint *restrict offsets, __global const float *restrict shadows,
    __global const float *restrict signs, __global const float *restrict bin_response,
    __global const int *restrict ends, int count, int slice, int slices, int bins, int window,
    int samples, int columns,
    __global float *scratch, __global const float *restrict turns, int length, int blocks, int items)
{
  const int item = (int)get_global_id(0);
  if (item >= items) return;
  const layout of = {order, starts, count, slice, slices, bins, window};
  const block mine[2] = BLOCKS_OF(item, scratch, length);
  for (int n = item; n < blocks; n += items) {
    for (int c = 0; c < BLOCK; c += LANES) {
      pack_views(views, &of, mine[0].re + c, BLOCK, n * BLOCK + c, 0, length);
      pack_views(views, &of, mine[0].im + c, BLOCK, columns + n * BLOCK + c, 0, length);
    }
    const block z = mine[transform_block(mine, turns, length)];
    for (int part = 0; part < 2; part++)
      for (int c = 0; c < BLOCK; c += LANES)
        weigh_views(
            z.re + c, z.im + c, BLOCK, part, length, rays, offsets, shadows, signs, bin_response, ends,
            part * columns + n * BLOCK + c, columns, count, samples, 0, samples);
  }
}
