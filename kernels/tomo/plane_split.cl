/* Copy slices into the padded planes that radon_project reads, as they are or transposed.
 *
 *     plane[slice][i][MARGIN + j] = TRANSPOSE ? image[slice0 + slice][j][i] : image[slice0 + slice][i][j].
 *
 * Index space: (tiles of columns, tiles of rows, slices of the plane). Each item copies one tile
 * of TILE x TILE, so that a transposed read uses whole cache lines. The margins stay as they
 * are: the caller clears the plane once.
 *
 * Buffers: image[slice0 + along2, rows, width], plane[along2, rows, width + 2 * margin]. */

#include "include/portable.h"

#ifndef TRANSPOSE
#define TRANSPOSE 0
#endif
#ifndef TILE
#define TILE (LANES == 8 ? 16 : 1)
#endif

KERNEL void plane_split(
    __global const real *restrict image, __global real *restrict plane,
    int slice0, int rows, int width, int margin)
{
  const int j0 = (int)get_global_id(0) * TILE, i0 = (int)get_global_id(1) * TILE;
  const int j1 = j0 + TILE < width ? j0 + TILE : width;
  const int i1 = i0 + TILE < rows ? i0 + TILE : rows;
  const long slice = get_global_id(2);
  const int pitch = width + 2 * margin;
  for (int i = i0; i < i1; i++)
    for (int j = j0; j < j1; j++)
      plane[(slice * rows + i) * pitch + margin + j] =
          image[(slice0 + slice) * rows * width + (TRANSPOSE ? (long)j * rows + i : (long)i * width + j)];
}
