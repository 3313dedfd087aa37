/* Image rows to phase tables: the transpose of radon_backproject.
 *
 *     F[r][k] = sum over rows i of phase r of (1-w) plane[i][k-m]
 *             + sum over rows i of phase r-1 of w plane[i][k-m],
 *     where the rows of phase PHASES-1 reach F[0] one column further on.
 *
 * Index space: items of all columns and views of this run, then slices. Each item owns
 * LANES * BLOCKS columns of one view's table. Rows come sorted by phase (`order`, with `starts` telling where
 * each phase begins), so that the sums of a phase and of the next stay in registers: one load and
 * two multiply-adds per LANES pixels, no atomics, one order of summation. The table is written
 * column by column (phases together), which is how radon_resample_adjoint reads it.
 *
 * The plane has SEGMENT zeros before and after every row, so that a segment that overhangs the
 * row needs no bounds test.
 *
 * Buffers: table[along2, count, columns, PHASES], plane[along2, rows, width + 2 * SEGMENT],
 * geometry[first + count, 4], orders[first + count, rows], all_starts[first + count, PHASES + 1],
 * views[first + count, 2]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"
#include "include/transpose.h"

/* Neighbouring items of a GPU take neighbouring segments, so that their loads are one. A CPU takes
 * one segment of all views of a run in turn: their rows lie in nearly the same band of the image,
 * which then stays in its cache. */
#define SEGMENT_AXIS (LANES == 8 ? 1 : 0)
#define VIEW_AXIS (1 - SEGMENT_AXIS)

/* Add rows `begin` to `end` of one phase; shift is 1 where the next phase is column + 1 of phase 0. */
static void add_rows(
    lanes *here, lanes *next, __global const real *image, __global const int *order, int begin,
    int end, long4 g, int k0, int width, const int shift)
{
  for (int n = begin; n < end; n++) {
    const int i = order[n];
    const long position = g.x + i * g.y;
    const int j = k0 - WHOLE(position);
    if (j <= -SEGMENT || j > width) continue;
    const real w = next_weight(position), u = 1.0f - w;
    __global const real *pixels = image + (long)i * (width + 2 * SEGMENT) + SEGMENT + j;
    UNROLL for (int b = 0; b < BLOCKS; b++) {
      lanes value = LOAD(pixels + b * STEP);
      here[b] = here[b] + u * value;
      if (shift) value = LOAD(pixels + b * STEP - 1);
      next[b] = next[b] + w * value;
    }
  }
}

KERNEL void radon_project(
    __global real *restrict table, __global const real *restrict plane,
    __global const long4 *restrict geometry, __global const int *restrict orders,
    __global const int *restrict all_starts, __global const int2 *restrict views,
    int first, int count, int columns, int rows, int width)
{
  const int k0 = FIRST_COLUMN((int)get_global_id(SEGMENT_AXIS));
  const int number = (int)get_global_id(VIEW_AXIS);
  const int view = first + number;
  const int slice = (int)get_global_id(2);
  if (k0 >= views[view].y) return;
  const long4 g = geometry[view];
  __global const real *image = plane + (long)slice * rows * (width + 2 * SEGMENT);
  __global const int *order = orders + (long)view * rows;
  __global const int *starts = all_starts + view * (PHASES + 1);
  lanes sums[PHASES][BLOCKS], next[BLOCKS];
  UNROLL for (int b = 0; b < BLOCKS; b++) next[b] = 0;
  for (int r = 0; r < PHASES; r++) {
    lanes here[BLOCKS];
    UNROLL for (int b = 0; b < BLOCKS; b++) { here[b] = next[b]; next[b] = 0; }
    if (r == PHASES - 1)
      add_rows(here, next, image, order, starts[r], starts[r + 1], g, k0, width, 1);
    else
      add_rows(here, next, image, order, starts[r], starts[r + 1], g, k0, width, 0);
    UNROLL for (int b = 0; b < BLOCKS; b++) sums[r][b] = here[b];
  }
  __global real *out = table + (((long)slice * count + number) * columns + k0) * PHASES;
  for (int b = 0; b < BLOCKS; b++) {
    lanes block[PHASES];
    UNROLL for (int r = 0; r < PHASES; r++) block[r] = sums[r][b];
    block[0] = block[0] + next[b];
    TRANSPOSE(block)
    UNROLL for (int n = 0; n < PHASES; n++) STORE(out + b * STEP * PHASES + n * LANES, block[n]);
  }
}
