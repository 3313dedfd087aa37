/* Projections to slab tables (see include/cone/slab_table.h).
 *
 *     table[view][r][pad + u] = gain * sum over rows i of
 *         weight(step (r + first) + center - i) length[i][u] data[view][i][u],
 *
 * step and gain being those of the column; where no column stands, entries are zero. `length` is
 * that of a ray in units of its reach across the detector.
 *
 * Index space: (runs of columns, rows of the table, views of this run). A CPU takes all columns of a
 * row, LANES at a time, a GPU one. `views` tells which view of the data each is, `firsts` which
 * row of the stretched view stands first in its table.
 *
 * Buffers: data[along2, detector_rows, bins], lengths[detector_rows, bins], table[along2, rows, columns],
 * views, firsts[first + along2], steps, gains[first + along2, columns]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"

#ifndef RUN
#define RUN LANES
#endif

/* LANES numbers of a row, zeros behind its last. */
static lanes some(__global const real *restrict row, int count) {
  if (count >= LANES) return LOAD(row);
  lanes found = 0;
  for (int n = 0; n < count; n++) ((real *)&found)[n] = row[n];
  return found;
}

KERNEL void slab_stretch(
    __global const real *restrict data, __global const real *restrict lengths,
    __global real *restrict table, __global const int *restrict views,
    __global const int *restrict firsts, __global const real *restrict steps,
    __global const real *restrict gains, int first, int detector_rows, int bins, int rows,
    int columns, int pad, real center)
{
  const int r = (int)get_global_id(1), view = (int)get_global_id(2);
  const int c0 = (int)get_global_id(0) * RUN;
  const int c1 = c0 + RUN < columns ? c0 + RUN : columns;
  const int stretched = r + firsts[first + view];
  __global const real *seen = data + (long)views[first + view] * detector_rows * bins;
  for (int c = c0; c < c1; c += LANES) {
    const int u = c - pad;
    lanes sum = 0;
    if (u >= 0 && u < bins) {
      const lanes step = LOAD(steps + (long)(first + view) * columns + c);
      const lanes place = step * (real)stretched + center;
      const lanes reach = row_reach(step);
      const real from = least(place - reach), to = largest(place + reach);
      const int begin = from > 0 ? (int)from : 0;
      const int end = to < detector_rows - 1 ? (int)to + 1 : detector_rows;
      for (int i = begin; i < end; i++)
        sum = sum + row_weight(stretched, step, center, i, detector_rows) *
                        (some(lengths + (long)i * bins + u, bins - u) *
                         some(seen + (long)i * bins + u, bins - u));
      sum = LOAD(gains + (long)(first + view) * columns + c) * sum;
    }
    STORE(table + ENTRY(view, r, c), sum);
  }
}
