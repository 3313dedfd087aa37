/* Slab tables to a volume (see include/cone/slab_table.h): the inner loops of backprojection.
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
 * each line blends its columns: per LANES samples and view TAPS loads and multiply-adds. Of shadows
 * a little wider than an entry few samples touch a third one, so that what has a share of zero is
 * left out: it would change no bit. VIEWS views are taken together, so that sums are loaded and
 * stored half as often.
 *
 * What holds it (Zen 4, PoCL, 128^3 voxels): instructions more than memory. The blend of rows takes
 * some 60 % of the time, since it loads, transposes and stores each number besides its two
 * multiply-adds; with one view's table read in the place of all the kernel is but a tenth faster.
 * Tried, and slower or faster by less than a twentieth: tiles of half as many z or lines, VIEWS 1 and
 * 4, rows asked for ahead, whole rows in lanes and a transposition of 8 x 8.
 *
 * Lines lie `line_stride` apart in the volume, slabs `slab_stride`; z is padded to whole runs, and
 * what is written there means nothing.
 *
 * Buffers: table[count, rows, columns],
 * volume[(slabs - 1) * slab_stride + (lines - 1) * line_stride + depth], places[count, slabs, padded_lines],
 * shares[count, slabs, TAPS - 1, padded_lines], row_places[count, slabs, depth],
 * row_shares[count, slabs, ROW_TAPS - 1, depth], amplitudes[first + count, slabs]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"
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
/* Lines in whole lanes, which an item's begin within where LINES is less than LANES. */
#define LINE_GROUPS ((LINES + LANES - 1) / LANES)
/* Lines that sums are asked for ahead of their use. */
#define AHEAD 4

/* Columns of one view's table that `table` begins with, blended for the z of an item. */
static void blend_rows(
    lanes (*tile)[GROUPS], __global const real *restrict table, __global const int *restrict places,
    __global const real *restrict shares, real amplitude, int columns, int depth, int width)
{
  long row[DEPTH];
  lanes weight[ROW_TAPS][GROUPS];
  for (int z = 0; z < DEPTH; z++) row[z] = (long)places[z] * columns;
  for (int g = 0; g < GROUPS; g++) {
    lanes rest = amplitude;
    UNROLL for (int t = 1; t < ROW_TAPS; t++) {
      weight[t][g] = amplitude * LOAD(shares + (t - 1) * depth + g * LANES);
      rest = rest - weight[t][g];
    }
    weight[0][g] = rest;
  }
  for (int g = 0; g < GROUPS; g++) {
    __global const real *low[4], *high[4];
    lanes weights[ROW_TAPS][4], beyond = 0;
    UNROLL for (int t = 2; t < ROW_TAPS; t++) beyond = beyond + weight[t][g];
    const int taps = ROW_TAPS > 2 && largest(beyond) > 0 ? ROW_TAPS : 2;
    UNROLL for (int n = 0; n < 4; n++) {
      const int z = g * LANES + n;
      low[n] = table + row[z];
      high[n] = table + row[z + 4];
      UNROLL for (int t = 0; t < ROW_TAPS; t++) {
        const real *of_tap = (const real *)weight[t];
        weights[t][n] = (lanes)((real4)of_tap[z], (real4)of_tap[z + 4]);
      }
    }
    for (int c = 0; c < width; c += 4) {
      lanes sums[4];
      UNROLL for (int n = 0; n < 4; n++)
        sums[n] = weights[0][n] * (lanes)(LOAD_HALF(low[n] + c), LOAD_HALF(high[n] + c));
      UNROLL for (int t = 1; t < ROW_TAPS; t++) {
        if (t >= taps) break;
        const int next = t * columns + c;
        UNROLL for (int n = 0; n < 4; n++)
          sums[n] += weights[t][n] * (lanes)(LOAD_HALF(low[n] + next), LOAD_HALF(high[n] + next));
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
  const int line = (int)get_global_id(0) * LINES, slab = (int)get_global_id(1);
  const int z0 = (int)get_global_id(2) * DEPTH;
  const int line0 = line / LANES * LANES, begin_line = line - line0;
  const int end_line = begin_line + LINES < lines - line0 ? begin_line + LINES : lines - line0;
  __global real *out = volume + slab * slab_stride + line0 * line_stride + z0;
  lanes tiles[VIEWS][WIDTH][GROUPS];
  int at[VIEWS][LINE_GROUPS * LANES];
  lanes weight[VIEWS][TAPS][LINE_GROUPS];
  for (int view0 = 0; view0 < count; view0 += VIEWS) {
    for (int v = 0; v < VIEWS; v++) {
      /* Behind the last view the last one is taken again, with weights of zero. */
      const int view = view0 + v < count ? view0 + v : count - 1;
      const real some = view0 + v < count;
      const long of_slab = (long)view * slabs + slab;
      __global const int *place = places + of_slab * padded_lines + line0;
      __global const real *share = shares + of_slab * (TAPS - 1) * padded_lines + line0;
      if (view + VIEWS < count) {
        const long next = of_slab + (long)VIEWS * slabs;
        ask_for(
            places + next * padded_lines + line0, shares + next * (TAPS - 1) * padded_lines + line0,
            TAPS, padded_lines, end_line);
        ask_for(
            row_places + next * depth + z0, row_shares + next * (ROW_TAPS - 1) * depth + z0,
            ROW_TAPS, depth, DEPTH);
      }
      const int one = place[begin_line], other = place[end_line - 1];
      const int begin = (one < other ? one : other) & ~3;
      const int end = (one < other ? other : one) + TAPS;
      for (int i = 0; i < end_line; i += LANES) {
        lanes rest = some;
        UNROLL for (int t = 1; t < TAPS; t++) {
          weight[v][t][i / LANES] = some * LOAD(share + (t - 1) * padded_lines + i);
          rest = rest - weight[v][t][i / LANES];
        }
        weight[v][0][i / LANES] = rest;
        UNROLL for (int n = 0; n < LANES; n++) at[v][i + n] = place[i + n] - begin;
      }
      blend_rows(
          tiles[v], table + ENTRY(view, 0, begin), row_places + of_slab * depth + z0,
          row_shares + of_slab * (ROW_TAPS - 1) * depth + z0,
          amplitudes[(long)(first + view) * slabs + slab], columns, depth, end - begin);
    }
    const int before = add || view0 > 0;
    for (int i = begin_line; i < end_line; i++) {
      __global real *o = out + i * line_stride;
      lanes sum[GROUPS];
      if (before) {
        UNROLL for (int g = 0; g < GROUPS; g += 2) PREFETCH(o + AHEAD * line_stride + g * LANES);
        UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = LOAD(o + g * LANES);
      } else {
        UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = 0;
      }
      UNROLL for (int v = 0; v < VIEWS; v++)
        UNROLL for (int t = 0; t < TAPS; t++) {
          const real w = ((const real *)weight[v][t])[i];
          if (t > 1 && w == 0) continue;
          const lanes(*column)[GROUPS] = tiles[v] + at[v][i] + t;
          UNROLL for (int g = 0; g < GROUPS; g++) sum[g] = sum[g] + w * (*column)[g];
        }
      UNROLL for (int g = 0; g < GROUPS; g++) STORE(o + g * LANES, sum[g]);
    }
  }
}
