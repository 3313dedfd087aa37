/* Slab tables to a volume (see include/cone/slab_table.h), for devices that want many small items.
 *
 *     volume[slab][line][z] = before + sum over views of amplitude[view][slab] *
 *         sum over columns c and rows r of f(line, c) g(z, r) table[view][r][c],
 *
 * before = volume[slab][line][z] if `add` is set, else 0.
 *
 * Index space: (z, lines, slabs). Items of a group are neighbours in z: they share the weights of
 * columns, and read neighbouring rows of the table, which are contiguous here.
 *
 * Buffers: table[count, rows, columns],
 * volume[(slabs - 1) * slab_stride + (along1 - 1) * line_stride + depth],
 * places[count, slabs, padded_lines], shares[count, slabs, TAPS - 1, padded_lines],
 * row_places[count, slabs, depth], row_shares[count, slabs, ROW_TAPS - 1, depth],
 * amplitudes[first + count, slabs]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"

KERNEL void slab_backproject_gpu(
    __global const real *restrict table, __global real *restrict volume,
    __global const int *restrict places, __global const real *restrict shares,
    __global const int *restrict row_places, __global const real *restrict row_shares,
    __global const real *restrict amplitudes, int first, int count, int rows, int columns,
    int padded_lines, int slabs, int depth, long line_stride, long slab_stride, int add)
{
  const int z = (int)get_global_id(0), line = (int)get_global_id(1), slab = (int)get_global_id(2);
  if (z >= depth) return;
  __global real *out = volume + slab * slab_stride + line * line_stride + z;
  real sum = add ? *out : 0;
  for (int view = 0; view < count; view++) {
    const long of_slab = (long)view * slabs + slab;
    const long of_line = of_slab * padded_lines + line, of_row = of_slab * depth + z;
    __global const real *entries = table + ENTRY(view, row_places[of_row], places[of_line]);
    __global const real *share_of = shares + of_slab * (TAPS - 1) * padded_lines + line;
    __global const real *row_share_of = row_shares + of_slab * (ROW_TAPS - 1) * depth + z;
    real seen = 0, rest = 1;
    for (int c = TAPS - 1; c >= 0; c--) {
      const real share = c > 0 ? share_of[(long)(c - 1) * padded_lines] : rest;
      real part = 0, rest_of_rows = 1;
      for (int r = ROW_TAPS - 1; r >= 0; r--) {
        const real row_share = r > 0 ? row_share_of[(long)(r - 1) * depth] : rest_of_rows;
        part += row_share * entries[(long)c * rows + r];
        rest_of_rows -= row_share;
      }
      seen += share * part;
      rest -= share;
    }
    sum += amplitudes[(long)(first + view) * slabs + slab] * seen;
  }
  *out = sum;
}
