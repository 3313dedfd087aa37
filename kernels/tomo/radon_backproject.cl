/* Phase tables to image rows (see include/tomo/phase_table.h): the inner loop of backprojection.
 *
 *     plane[slice][i][j] = before + sum over views of (1-w) F[r][m+j] + w F[r+1][m+j],
 *
 * before = plane[slice][i][j] if `add` is set, else 0.
 *
 * Index space: (items of all columns, runs of ROWS rows, slices). Each item owns ROWS rows of
 * LANES * BLOCKS pixels and keeps a row's sums in registers. On a CPU views are taken VIEWS at a
 * time, so that the pieces of their tables that a run of rows touches stay in the first-level cache;
 * a GPU's item has one row and goes through all views. Per LANES pixels and view: two loads, two
 * multiply-adds.
 *
 * Columns of the plane are padded to whole segments, rows are not.
 *
 * Buffers: table[along2, count, PHASES, columns], plane[along2, rows, width], geometry[first + count, 4]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"

#ifndef ROWS
#define ROWS (LANES == 8 ? 64 : 1)
#endif
#ifndef VIEWS
#define VIEWS (LANES == 8 ? 8 : 1 << 30)
#endif

KERNEL void radon_backproject(
    __global const real *restrict table, __global real *restrict plane,
    __global const long4 *restrict geometry, int first, int count, int columns, int rows, int width,
    int add)
{
  const int j = FIRST_COLUMN((int)get_global_id(0));
  const int row0 = (int)get_global_id(1) * ROWS;
  const int row1 = row0 + ROWS < rows ? row0 + ROWS : rows;
  const int slice = (int)get_global_id(2);
  if (j >= width) return;
  for (int view0 = 0; view0 < count; view0 += VIEWS) {
    const int view1 = view0 + VIEWS < count ? view0 + VIEWS : count;
    for (int i = row0; i < row1; i++) {
      __global real *pixels = plane + ((long)slice * rows + i) * width + j;
      lanes sum[BLOCKS];
      if (add || view0 > 0) {
        UNROLL for (int n = 0; n < BLOCKS; n++) sum[n] = LOAD(pixels + n * STEP);
      } else {
        UNROLL for (int n = 0; n < BLOCKS; n++) sum[n] = 0;
      }
      for (int view = view0; view < view1; view++) {
        const long position = geometry[first + view].x + i * geometry[first + view].y;
        const int r = phase_of(position);
        const real w = next_weight(position), u = 1.0f - w;
        __global const real *at =
            table + (((long)slice * count + view) * PHASES + r) * columns + WHOLE(position) + j;
        __global const real *next = r == PHASES - 1 ? at - (PHASES - 1) * columns + 1 : at + columns;
        UNROLL for (int n = 0; n < BLOCKS; n++) {
          sum[n] = MULTIPLY_ADD(u, LOAD(at + n * STEP), sum[n]);
          sum[n] = MULTIPLY_ADD(w, LOAD(next + n * STEP), sum[n]);
        }
      }
      UNROLL for (int n = 0; n < BLOCKS; n++) STORE(pixels + n * STEP, sum[n]);
    }
  }
}
