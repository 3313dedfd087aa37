/* Copy between a volume as users hold it, x contiguous, and one in slabs, whose last axis is that
 * of the lanes.
 *
 *     slabs[i][j][k] = volume[i volume_i + j volume_j + k volume_k],   zeros for k >= depth,
 *
 * and with BACK 1 the other way round. slabs[i][j] lies at i slab_stride + j line_stride.
 *
 * Index space: (tiles of j, tiles of k, i). Each item copies one tile of TILE x TILE, so that both
 * sides use whole cache lines.
 *
 * Buffers: volume[(along2 - 1) * volume_i + (lines - 1) * volume_j + (depth - 1) * volume_k + 1],
 * slabs[(along2 - 1) * slab_stride + (lines - 1) * line_stride + padded_depth]. */

#include "include/portable.h"

#ifndef BACK
#define BACK 0
#endif
#ifndef TILE
#define TILE (LANES == 8 ? 16 : 1)
#endif

KERNEL void volume_turn(
    __global real *restrict volume, __global real *restrict slabs, int lines, int depth,
    int padded_depth, long volume_i, long volume_j, long volume_k, long slab_stride,
    long line_stride)
{
  const int j0 = (int)get_global_id(0) * TILE, k0 = (int)get_global_id(1) * TILE;
  const int j1 = j0 + TILE < lines ? j0 + TILE : lines;
  const int k1 = k0 + TILE < padded_depth ? k0 + TILE : padded_depth;
  const long i = get_global_id(2);
  for (int j = j0; j < j1; j++)
    for (int k = k0; k < k1; k++) {
      __global real *turned = slabs + i * slab_stride + j * line_stride + k;
      __global real *given = volume + i * volume_i + j * volume_j + k * volume_k;
      if (!BACK) *turned = k < depth ? *given : 0;
      else if (k < depth) *given = *turned;
    }
}
