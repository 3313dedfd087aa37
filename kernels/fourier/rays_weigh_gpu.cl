/* Transforms of pairs of views become rays of the spectrum, for GPUs (see
 * include/fourier/view_columns.h).
 *
 * Index space: (blocks of LANES columns, blocks of LANES samples, parts).
 *
 * Buffers: fields[2, length, columns], rays[2, count, samples], turns[2 * columns], shadows[2, 2 * columns],
 * signs[2 * columns], bins[samples], ends[count]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/turn.h"
#include "include/fourier/ray_response.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/view_columns.h"

KERNEL void rays_weigh_gpu(
    __global const float *restrict fields, __global float *restrict rays,
    __global const uint *restrict turns, __global const float *restrict shadows,
    __global const float *restrict signs, __global const float *restrict bins,
    __global const int *restrict ends, int count, int samples, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, l = (int)get_global_id(1) * LANES;
  const int part = (int)get_global_id(2);
  if (c >= columns) return;
  __global const float *zr = fields + c, *zi = zr + (long)length * columns;
  weigh_views(
      zr, zi, columns, part, length, rays, turns, shadows, signs, bins, ends, part * columns + c, columns,
      count, samples, l, l + LANES);
}
