/* Slab tables to a volume (see include/slab_table.h): the inner loops of backprojection.
 *
 *     volume[slab][line][z] = before + sum over views of amplitude[view][slab] *
 *         sum over columns c and rows r of f(line, c) g(z, r) table[view][r][c],
 *
 * before = volume[slab][line][z] if `add` is set, else 0.
 *
 * Index space: (runs of LINES lines, slabs, runs of DEPTH z). For each view an item first blends the
 * table's rows for its z, in the columns that its lines see, LANES columns at a time: half rows of
 * two z that are 4 apart fill the lanes, so that a transposition of 4 x 4 numbers within halves puts
 * z into the lanes. The blend, WIDTH columns of DEPTH numbers, stays in the first-level cache. Then
 * each line blends its columns: per LANES samples and view TAPS loads and multiply-adds. VIEWS views
 * are taken together, so that sums are loaded and stored half as often.
 *
 * Lines lie `line_stride` apart in the volume, slabs `slab_stride`; z is padded to whole runs, and
 * what is written there means nothing. */

#include "include/portable.h"
#include "include/slab_table.h"
#include "include/transpose.h"

#ifndef LINES
#define LINES 64
#endif
#ifndef DEPTH
#define DEPTH 64
#endif
#ifndef WIDTH
#define WIDTH 96
#endif
#ifndef VIEWS
#define VIEWS 2
#endif
#define GROUPS (DEPTH / LANES)

/* Columns from `begin` on of one view's table, blended for the z of an item. */
static void blend_rows(
    lanes (*tile)[GROUPS], __global const real *restrict table, __global const int *restrict places,
    __global const real *restrict shares, real amplitude, int columns, int width)
{
  long row[DEPTH];
  real weight[ROW_TAPS][DEPTH];
  for (int z = 0; z < DEPTH; z++) {
    real rest = amplitude;
    row[z] = (long)places[z] * columns;
    for (int t = 1; t < ROW_TAPS; t++) {
      weight[t][z] = amplitude * shares[z * (ROW_TAPS - 1) + t - 1];
      rest -= weight[t][z];
    }
    weight[0][z] = rest;
  }
  for (int g = 0; g < GROUPS; g++) {
    lanes weights[ROW_TAPS][4];
    __global const real *low[4], *high[4];
    UNROLL for (int n = 0; n < 4; n++) {
      const int z = g * LANES + n;
      low[n] = table + row[z];
      high[n] = table + row[z + 4];
      UNROLL for (int t = 0; t < ROW_TAPS; t++)
        weights[t][n] = (lanes)((real4)weight[t][z], (real4)weight[t][z + 4]);
    }
    for (int c = 0; c < width; c += 4) {
      lanes sums[4];
      UNROLL for (int n = 0; n < 4; n++) {
        sums[n] = weights[0][n] * (lanes)(LOAD_HALF(low[n] + c), LOAD_HALF(high[n] + c));
        UNROLL for (int t = 1; t < ROW_TAPS; t++) {
          const int next = t * columns + c;
          sums[n] += weights[t][n] * (lanes)(LOAD_HALF(low[n] + next), LOAD_HALF(high[n] + next));
        }
      }
      transpose_halves(sums);
      UNROLL for (int n = 0; n < 4; n++) tile[c + n][g] = sums[n];
    }
  }
}

KERNEL void slab_backproject_cpu(
    __global const real *restrict table, __global real *restrict volume,
    __global const int *restrict places, __global const real *restrict shares,
    __global const int *restrict row_places, __global const real *restrict row_shares,
    __global const real *restrict amplitudes, int first, int count, int rows, int columns,
    int lines, int padded_lines, int slabs, int depth, long line_stride, long slab_stride, int add)
{
  const int line0 = (int)get_global_id(0) * LINES, slab = (int)get_global_id(1);
  const int z0 = (int)get_global_id(2) * DEPTH;
  const int here = lines - line0 < LINES ? lines - line0 : LINES;
  __global real *out = volume + slab * slab_stride + line0 * line_stride + z0;
  lanes tiles[VIEWS][WIDTH][GROUPS];
  int at[VIEWS][LINES];
  real weight[VIEWS][TAPS][LINES];
  for (int view0 = 0; view0 < count; view0 += VIEWS) {
    for (int v = 0; v < VIEWS; v++) {
      /* Behind the last view the last one is taken again, with weights of zero. */
      const int view = view0 + v < count ? view0 + v : count - 1;
      const real some = view0 + v < count;
      const long of_slab = (long)view * slabs + slab;
      __global const int *place = places + of_slab * padded_lines + line0;
      __global const real *share = shares + (of_slab * padded_lines + line0) * (TAPS - 1);
      const int last = place[here - 1];
      const int begin = (place[0] < last ? place[0] : last) & ~3;
      const int end = (place[0] < last ? last : place[0]) + TAPS;
      for (int i = 0; i < here; i++) {
        real rest = some;
        at[v][i] = place[i] - begin;
        for (int t = 1; t < TAPS; t++) {
          weight[v][t][i] = some * share[i * (TAPS - 1) + t - 1];
          rest -= weight[v][t][i];
        }
        weight[v][0][i] = rest;
      }
      blend_rows(
          tiles[v], table + ENTRY(view, 0, begin), row_places + of_slab * depth + z0,
          row_shares + (of_slab * depth + z0) * (ROW_TAPS - 1),
          amplitudes[(long)(first + view) * slabs + slab], columns, end - begin);
    }
    for (int i = 0; i < here; i++) {
      __global real *o = out + i * line_stride;
      lanes sum[GROUPS];
      if (add || view0 > 0) {
        UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = LOAD(o + g * LANES);
      } else {
        UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = 0;
      }
      UNROLL for (int v = 0; v < VIEWS; v++)
        UNROLL for (int t = 0; t < TAPS; t++) {
          const real w = weight[v][t][i];
          const lanes(*column)[GROUPS] = tiles[v] + at[v][i] + t;
          UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = sum[g] + w * (*column)[g];
        }
      UNROLL for (int g = 0; g < GROUPS; g++) STORE(o + g * LANES, sum[g]);
    }
  }
}
