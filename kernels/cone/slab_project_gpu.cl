/* A volume to slab tables: the transpose of slab_backproject_gpu.
 *
 *     table[view][r][c] = sum over slabs, lines and z of
 *         amplitude[view][slab] f(line, c) g(z, r) volume[slab][line][z].
 *
 * Index space: (rows of the table, columns, views of this run). Each item gathers, slab after slab,
 * the lines that reach its column and the z that reach its row. Both follow each other in the order
 * of their places, so that the first of a slab is found near that of the slab before. Items of a
 * group are neighbours in rows: they take the same lines, and z beside each other.
 *
 * Buffers: table[count, rows, columns],
 * volume[(slabs - 1) * slab_stride + (lines - 1) * line_stride + depth], places[count, slabs, padded_lines],
 * shares[count, slabs, TAPS - 1, padded_lines], row_places[count, slabs, depth],
 * row_shares[count, slabs, ROW_TAPS - 1, depth], amplitudes[first + count, slabs]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"

/* What one of a sample's entries receives, of which `shares` has the second one's; those of the
 * entries behind it are `samples` apart. */
static real share_of(__global const real *shares, int samples, int taps, int tap) {
  if (tap > 0) return shares[(long)(tap - 1) * samples];
  real rest = 1;
  for (int t = taps - 1; t > 0; t--) rest -= shares[(long)(t - 1) * samples];
  return rest;
}

KERNEL void slab_project_gpu(
    __global real *restrict table, __global const real *restrict volume,
    __global const int *restrict places, __global const real *restrict shares,
    __global const int *restrict row_places, __global const real *restrict row_shares,
    __global const real *restrict amplitudes, int first, int count, int rows, int columns,
    int lines, int padded_lines, int slabs, int depth, long line_stride, long slab_stride)
{
  const int row = (int)get_global_id(0), column = (int)get_global_id(1);
  const int view = (int)get_global_id(2);
  if (row >= rows) return;
  int k = 0, z0 = 0;
  real sum = 0;
  for (int slab = 0; slab < slabs; slab++) {
    const long of_slab = (long)view * slabs + slab;
    __global const int *place = places + of_slab * padded_lines;
    __global const int *row_place = row_places + of_slab * depth;
    const int upwards = place[0] <= place[lines - 1];
#define LINE(k) (upwards ? (k) : lines - 1 - (k))
    while (k > 0 && place[LINE(k - 1)] > column - TAPS) k--;
    while (k < lines && place[LINE(k)] <= column - TAPS) k++;
    while (z0 > 0 && row_place[z0 - 1] > row - ROW_TAPS) z0--;
    while (z0 < depth && row_place[z0] <= row - ROW_TAPS) z0++;
    real seen = 0;
    for (int n = k; n < lines && place[LINE(n)] <= column; n++) {
      const long line = LINE(n), of_line = of_slab * (TAPS - 1) * padded_lines + line;
      __global const real *values = volume + slab * slab_stride + line * line_stride;
      real part = 0;
      for (int z = z0; z < depth && row_place[z] <= row; z++)
        part += share_of(row_shares + of_slab * (ROW_TAPS - 1) * depth + z, depth, ROW_TAPS,
                         row - row_place[z]) * values[z];
      seen += share_of(shares + of_line, padded_lines, TAPS, column - place[line]) * part;
    }
    sum += amplitudes[(long)(first + view) * slabs + slab] * seen;
  }
  table[ENTRY(view, row, column)] = sum;
}
