/* A volume to slab tables: the transpose of slab_backproject_cpu.
 *
 *     table[view][r][c] = sum over slabs, lines and z of
 *         amplitude[view][slab] f(line, c) g(z, r) volume[slab][line][z].
 *
 * Index space: (runs of WIDTH columns, groups of VIEWS views). Each item owns these columns of its
 * views' tables and walks the volume, slab after slab, DEPTH z at a time. Lines follow each other in
 * the order of their columns, so that the sums of TAPS columns wait in registers until the last line
 * that reaches the first of them has come; z does so along the rows, once 8 columns are transposed
 * into lanes. No atomics, one order of summation. Views are grouped since each of them reads the
 * same slab, which is then in the cache.
 *
 * What holds it (Zen 4, PoCL, 128^3 voxels): half of the time goes into the blend of lines, half into
 * that of rows, where each number is loaded and transposed besides its multiply-adds, and each z asks
 * whether a row is done. Tried, and slower: lines without the third column where its share is zero,
 * and rows of 16 columns at a time.
 *
 * The volume is that of slab_backproject_cpu; its z behind the last are zeros.
 *
 * Buffers: table[count, rows, columns],
 * volume[(slabs - 1) * slab_stride + (lines - 1) * line_stride + depth], places[count, slabs, padded_lines],
 * shares[count, slabs, TAPS - 1, padded_lines], row_places[count, slabs, depth],
 * row_shares[count, slabs, ROW_TAPS - 1, depth], amplitudes[first + count, slabs]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"
#include "include/transpose.h"

#ifndef DEPTH
#define DEPTH 64
#endif
#ifndef WIDTH
#define WIDTH 64
#endif
#ifndef VIEWS
#define VIEWS 8
#endif
#define GROUPS (DEPTH / LANES)
/* Columns of a tile: those before the item's own that its lines may reach, then whole lanes. */
#define BEFORE (TAPS - 1)
#define TILE (BEFORE + WIDTH)

/* Lanes of z whose sums of TAPS columns wait in registers at a time: some twelve registers, which
 * leaves a few of a CPU's sixteen for values and weights. All parts are equally long, so that the
 * last may overlap the one before, whose numbers it then computes again. */
#define PARTS ((TAPS * GROUPS + 11) / 12 < GROUPS ? (TAPS * GROUPS + 11) / 12 : GROUPS)
#define HELD ((GROUPS + PARTS - 1) / PARTS)

/* The first line of a slab that an item's columns see, in the order of columns, or `lines`. */
#define LINE(k) (upwards ? (k) : lines - 1 - (k))
static int first_line(
    __global const int *restrict places, int before, int lines, int upwards, int first_column)
{
  int k = before;
  while (k > 0 && places[LINE(k - 1)] >= first_column) k--;
  while (k < lines && places[LINE(k)] < first_column) k++;
  return k;
}

/* The part of a slab's lines from the k-th on in an item's columns, HELD lanes of z from `group`
 * on: tile[c][z]; returns its width. `volume` begins with that z. */
static int blend_lines(
    lanes (*tile)[GROUPS], __global const real *restrict volume, __global const int *restrict places,
    __global const real *restrict shares, int group, int k, int lines, int padded_lines, int upwards,
    long line_stride, int first_column)
{
  lanes sums[TAPS][HELD];
  UNROLL for (int t = 0; t < TAPS; t++)
    UNROLL for (int g = 0; g < HELD; g++) sums[t][g] = 0;
  int column = 0;
  for (; k < lines; k++) {
    const int line = LINE(k), place = places[line] - first_column;
    if (place >= TILE) break;
    for (; column < place; column++) {
      UNROLL for (int g = 0; g < HELD; g++) {
        tile[column][group + g] = sums[0][g];
        UNROLL for (int t = 1; t < TAPS; t++) sums[t - 1][g] = sums[t][g];
        sums[TAPS - 1][g] = 0;
      }
    }
    real weight[TAPS];
    weight[0] = 1;
    UNROLL for (int t = 1; t < TAPS; t++) {
      weight[t] = shares[(t - 1) * padded_lines + line];
      weight[0] -= weight[t];
    }
    __global const real *values = volume + line * line_stride;
    UNROLL for (int g = 0; g < HELD; g++) {
      const lanes value = LOAD(values + g * LANES);
      UNROLL for (int t = 0; t < TAPS; t++) sums[t][g] = sums[t][g] + weight[t] * value;
    }
  }
  UNROLL for (int t = 0; t < TAPS; t++, column++)
    if (column < TILE)
      UNROLL for (int g = 0; g < HELD; g++) tile[column][group + g] = sums[t][g];
  column = column < TILE ? column : TILE;
  for (; (column - BEFORE) % LANES != 0; column++)
    UNROLL for (int g = 0; g < HELD; g++) tile[column][group + g] = 0;
  return column - BEFORE;
}

/* Shares of the rows that a run of z reaches, times a slab's amplitude. */
static void weigh_rows(
    lanes (*weight)[GROUPS], __global const real *restrict shares, real amplitude, int depth)
{
  for (int g = 0; g < GROUPS; g++) {
    lanes rest = amplitude;
    UNROLL for (int t = 1; t < ROW_TAPS; t++) {
      weight[t][g] = amplitude * LOAD(shares + (t - 1) * depth + g * LANES);
      rest = rest - weight[t][g];
    }
    weight[0][g] = rest;
  }
}

/* Add tile[c][z] of 8 columns to a table's rows. */
static void add_rows(
    __global real *restrict table, lanes (*tile)[GROUPS], __global const int *restrict places,
    const lanes (*weight)[GROUPS], int columns)
{
  lanes sums[ROW_TAPS];
  UNROLL for (int t = 0; t < ROW_TAPS; t++) sums[t] = 0;
  int row = places[0];
  __global real *at = table + (long)row * columns;
  for (int g = 0; g < GROUPS; g++)
    for (int upper = 0; upper < 2; upper++) {
      lanes values[4];
      UNROLL for (int n = 0; n < 4; n++)
        values[n] = upper ? (lanes)(tile[n][g].hi, tile[n + 4][g].hi)
                          : (lanes)(tile[n][g].lo, tile[n + 4][g].lo);
      transpose_halves(values);
      UNROLL for (int n = 0; n < 4; n++) {
        const int z = g * LANES + 4 * upper + n;
        for (; row < places[z]; row++, at += columns) {
          STORE(at, LOAD(at) + sums[0]);
          UNROLL for (int t = 1; t < ROW_TAPS; t++) sums[t - 1] = sums[t];
          sums[ROW_TAPS - 1] = 0;
        }
        UNROLL for (int t = 0; t < ROW_TAPS; t++)
          sums[t] = sums[t] + ((const real *)weight[t])[z] * values[n];
      }
    }
  UNROLL for (int t = 0; t < ROW_TAPS; t++, at += columns) STORE(at, LOAD(at) + sums[t]);
}

KERNEL void slab_project_cpu(
    __global real *restrict table, __global const real *restrict volume,
    __global const int *restrict places, __global const real *restrict shares,
    __global const int *restrict row_places, __global const real *restrict row_shares,
    __global const real *restrict amplitudes, int first, int count, int rows, int columns, int pad,
    int lines, int padded_lines, int slabs, int depth, long line_stride, long slab_stride)
{
  const int column0 = pad + (int)get_global_id(0) * WIDTH, view0 = (int)get_global_id(1) * VIEWS;
  const int view1 = view0 + VIEWS < count ? view0 + VIEWS : count;
  const int own = columns - column0 < WIDTH ? columns - column0 : WIDTH;
  for (int view = view0; view < view1; view++)
    for (int r = 0; r < rows; r++)
      for (int c = 0; c < own; c += LANES) STORE(table + ENTRY(view, r, column0 + c), (lanes)0);
  lanes tile[TILE][GROUPS], weight[ROW_TAPS][GROUPS];
  for (int z0 = 0; z0 < depth; z0 += DEPTH) {
    int begin[VIEWS];
    for (int v = 0; v < VIEWS; v++) begin[v] = 0;
    for (int slab = 0; slab < slabs; slab++)
      for (int view = view0; view < view1; view++) {
        const long of_slab = (long)view * slabs + slab;
        __global const int *place = places + of_slab * padded_lines;
        const int upwards = place[0] <= place[lines - 1], first_column = column0 - BEFORE;
        /* The first line of the item is near that of the slab before. */
        const int k = first_line(place, begin[view - view0], lines, upwards, first_column);
        begin[view - view0] = k;
        if (k == lines || place[LINE(k)] >= column0 + WIDTH) continue;
        const long next = view + 1 < view1 ? of_slab + slabs : (long)view0 * slabs + slab + 1;
        if (next < (long)count * slabs) {
          const int last = lines - 1 - k, near = upwards ? k : last > WIDTH ? last - WIDTH : 0;
          ask_for(
              places + next * padded_lines + near,
              shares + next * (TAPS - 1) * padded_lines + near, TAPS, padded_lines, WIDTH);
          ask_for(
              row_places + next * depth + z0, row_shares + next * (ROW_TAPS - 1) * depth + z0,
              ROW_TAPS, depth, DEPTH);
        }
        int width = 0;
        for (int part = 0; part < PARTS; part++) {
          const int group = part * HELD < GROUPS - HELD ? part * HELD : GROUPS - HELD;
          width = blend_lines(
              tile, volume + slab * slab_stride + z0 + group * LANES, place,
              shares + of_slab * (TAPS - 1) * padded_lines, group, k, lines, padded_lines, upwards,
              line_stride, first_column);
        }
        weigh_rows(
            weight, row_shares + of_slab * (ROW_TAPS - 1) * depth + z0,
            amplitudes[(long)(first + view) * slabs + slab], depth);
        for (int c = 0; c < width && c < own; c += LANES)
          add_rows(
              table + ENTRY(view, 0, column0 + c), tile + BEFORE + c,
              row_places + of_slab * depth + z0, weight, columns);
      }
  }
}
