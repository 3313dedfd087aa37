/* Slab tables to projections: the transpose of slab_stretch.
 *
 *     data[view][i][u] = length[i][u] * sum over rows r of
 *         weight(step (r + first) + center - i) gain table[view][r][pad + u].
 *
 * Index space: (runs of columns, rows of the detector, views of this run). Each item gathers, for
 * its bins, the table's rows that reach them: no two write the same bin.
 *
 * Buffers: data[along2, detector_rows, bins], lengths[detector_rows, bins], table[along2, rows, columns],
 * views, firsts[first + along2], steps, gains[first + along2, columns]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"

#ifndef RUN
#define RUN LANES
#endif

KERNEL void slab_stretch_adjoint(
    __global real *restrict data, __global const real *restrict lengths,
    __global const real *restrict table, __global const int *restrict views,
    __global const int *restrict firsts, __global const real *restrict steps,
    __global const real *restrict gains, int first, int detector_rows, int bins, int rows,
    int columns, int pad, real center)
{
  const int i = (int)get_global_id(1), view = (int)get_global_id(2);
  const int u0 = (int)get_global_id(0) * RUN;
  const int u1 = u0 + RUN < bins ? u0 + RUN : bins;
  const int origin = firsts[first + view];
  __global real *out = data + ((long)views[first + view] * detector_rows + i) * bins;
  __global const real *length = lengths + (long)i * bins;
  for (int u = u0; u < u1; u += LANES) {
    const lanes step = LOAD(steps + (long)(first + view) * columns + pad + u);
    const lanes place = ((real)i - center) / step, reach = row_reach(step) / step;
    const real from = least(place - reach) - origin, to = largest(place + reach) - origin;
    const int begin = from > 0 ? (int)from : 0, end = to < rows - 1 ? (int)to + 1 : rows;
    lanes sum = 0;
    for (int r = begin; r < end; r++)
      sum = sum + row_weight(r + origin, step, center, i, detector_rows) *
                      LOAD(table + ENTRY(view, r, pad + u));
    sum = LOAD(gains + (long)(first + view) * columns + pad + u) * sum;
    for (int n = 0; n < LANES && u + n < bins; n++) out[u + n] = length[u + n] * ((real *)&sum)[n];
  }
}
