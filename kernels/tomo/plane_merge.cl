/* Add the two planes of a backprojection, rows and columns, into the image.
 *
 *     image[slice0 + slice][y][x] = by_rows[slice][y][x] + by_columns[slice][x][y].
 *
 * Index space: (tiles of x, tiles of y, slices). Each item owns one tile of TILE x TILE, so that
 * the transposed read uses whole cache lines. The planes' rows are padded to `row_pitch` and
 * `column_pitch`.
 *
 * Buffers: by_rows[along2, ny, row_pitch], by_columns[along2, nx, column_pitch],
 * image[slice0 + along2, ny, nx]. */

#include "include/portable.h"

#ifndef TILE
#define TILE (LANES == 8 ? 16 : 1)
#endif

KERNEL void plane_merge(
    __global const real *restrict by_rows, __global const real *restrict by_columns,
    __global real *restrict image, int slice0, int ny, int nx, int row_pitch, int column_pitch)
{
  const int x0 = (int)get_global_id(0) * TILE, y0 = (int)get_global_id(1) * TILE;
  const int x1 = x0 + TILE < nx ? x0 + TILE : nx;
  const int y1 = y0 + TILE < ny ? y0 + TILE : ny;
  const long slice = get_global_id(2);
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++)
      image[((slice0 + slice) * ny + y) * nx + x] = by_rows[(slice * ny + y) * row_pitch + x] +
                                         by_columns[(slice * nx + x) * column_pitch + y];
}
