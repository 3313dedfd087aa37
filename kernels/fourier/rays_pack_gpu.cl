/* Views become the complex columns of a Fourier transform, for GPUs (see
 * include/fourier/view_columns.h).
 *
 * Index space: (blocks of LANES columns, blocks of LANES rows, parts). Length and columns are
 * multiples of LANES.
 *
 * Buffers: views[rays, slices, bins], fields[along2, length, columns], order, starts[rays]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/turn.h"
#include "include/fourier/ray_response.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/view_columns.h"

KERNEL void rays_pack_gpu(
    __global const float *restrict views, __global float *restrict fields,
    __global const int *restrict order, __global const int *restrict starts,
    int rays, int slice, int slices, int bins, int window, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, r = (int)get_global_id(1) * LANES;
  const int part = (int)get_global_id(2);
  if (c >= columns) return;
  const layout of = {order, starts, rays, slice, slices, bins, window};
  __global float *out = fields + (long)part * length * columns + c;
  pack_views(views, &of, out, columns, part * columns + c, r, r + LANES);
}
