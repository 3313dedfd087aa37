/* Tables of splats, LANES rows at a time: the lanes are splats, and each column is one vector.
 *
 * A splat's numbers stand side by side in its row, so that a column of eight splats would be eight
 * reads and as many insertions. Instead four columns at a time are read whole: row l into the lower
 * half of vector l and row l + 4 into its upper half, l = 0 .. 3, and 4 x 4 numbers are exchanged
 * within the halves (transpose.h), which is 8 reads and 8 shuffles for 32 numbers. Columns go back
 * the same way; those that fill no four are written number by number.
 *
 * Where a row's length is no multiple of four, its last four reach into the row behind it. So all of
 * this is done only for rows that are followed by another; the last ones of a table, up to LANES, go
 * number by number, and lanes without a row repeat the last.
 *
 * A work-item goes through RUN rows, as a group for each eight would cost as much as its work. */

#include "include/lane_vectors.h"
#include "include/transpose.h"
#include "include/lane_quads.h"

#ifndef RUN
#define RUN (LANES == 8 ? 64 : 1)
#endif
/* Over the runs of this work-item, from row to row of them. */
#define EACH_RUN(first, count) \
  for (long first = (long)get_global_id(0) * RUN, run_end = first + RUN < (count) ? first + RUN : (count); \
       first < run_end; first += LANES)

#if LANES == 8 && RIFT_POCL
#define STORE_QUAD(p, v) (*(__global quad_at *)(p) = (v))
#define KEEP_QUAD(p, v) (*(quad_at *)(p) = (v))
#elif LANES == 8
#define STORE_QUAD(p, v) vstore4(v, 0, p)
#define KEEP_QUAD(p, v) vstore4(v, 0, p)
#endif

/* Whether this work-item has a run: a group may be longer than what is left, and what the items without
 * one would add to, be it zero, is another's memory. */
#define HAS_RUN(count) ((long)get_global_id(0) * RUN < (count))

/* The first of LANES rows, how many there are of them, and whether another follows. */
typedef struct {
  long first;
  int count, followed;
} Rows;

static Rows rows_at(long first, long count) {
  Rows r;
  r.first = first;
  r.count = count - first < LANES ? (int)(count - first) : LANES;
  r.followed = first + LANES < count;
  return r;
}

/* The lanes that have a row of their own: what is summed over splats takes these alone. */
static lanes_int are_there(Rows rows) { return TO_INT(LANE_NUMBERS) < rows.count; }

/* Columns from .. from + width - 1 of rows of `stride` numbers. */
static void read_columns(
    __global const float *table, const int stride, const int from, const int width, Rows rows, lanes *column)
{
  __global const float *p = table + rows.first * stride + from;
#if LANES == 8
  if (rows.followed) {
    if (stride == 1) {
      column[0] = LOAD(p);
      return;
    }
    UNROLL for (int k = 0; k < width; k += 4) {
      lanes v[4];
      UNROLL for (int l = 0; l < 4; l++)
        v[l] = (lanes)(QUAD(p + l * stride + k), QUAD(p + (l + 4) * stride + k));
      transpose_halves(v);
      UNROLL for (int t = 0; t < 4; t++) if (k + t < width) column[k + t] = v[t];
    }
    return;
  }
  for (int l = 0; l < LANES; l++)
    UNROLL for (int k = 0; k < width; k++)
      ((float *)(column + k))[l] = p[(l < rows.count ? l : rows.count - 1) * stride + k];
#else
  UNROLL for (int k = 0; k < width; k++) column[k] = p[k];
#endif
}

static void write_columns(
    __global float *table, const int stride, const int from, const int width, Rows rows, const lanes *column)
{
  __global float *p = table + rows.first * stride + from;
#if LANES == 8
  if (rows.followed) {
    if (stride == 1) {
      STORE(p, column[0]);
      return;
    }
    UNROLL for (int k = 0; k + 4 <= width; k += 4) {
      lanes v[4];
      UNROLL for (int t = 0; t < 4; t++) v[t] = column[k + t];
      transpose_halves(v);
      UNROLL for (int l = 0; l < 4; l++) STORE_QUAD(p + l * stride + k, v[l].lo);
      UNROLL for (int l = 0; l < 4; l++) STORE_QUAD(p + (l + 4) * stride + k, v[l].hi);
    }
    UNROLL for (int k = width & ~3; k < width; k++)
      UNROLL for (int l = 0; l < LANES; l++) p[l * stride + k] = ((const float *)(column + k))[l];
    return;
  }
  for (int l = 0; l < rows.count; l++)
    UNROLL for (int k = 0; k < width; k++) p[l * stride + k] = ((const float *)(column + k))[l];
#else
  UNROLL for (int k = 0; k < width; k++) p[k] = column[k];
#endif
}

/* Columns as rows in memory of the work-item's own, which has room for LANES of them. */
static void keep_columns(lanes *table, const int stride, const int from, const int width, const lanes *column) {
  float *p = (float *)table + from;
#if LANES == 8
  UNROLL for (int k = 0; k + 4 <= width; k += 4) {
    lanes v[4];
    UNROLL for (int t = 0; t < 4; t++) v[t] = column[k + t];
    transpose_halves(v);
    UNROLL for (int l = 0; l < 4; l++) KEEP_QUAD(p + l * stride + k, v[l].lo);
    UNROLL for (int l = 0; l < 4; l++) KEEP_QUAD(p + (l + 4) * stride + k, v[l].hi);
  }
  UNROLL for (int k = width & ~3; k < width; k++)
    UNROLL for (int l = 0; l < LANES; l++) p[l * stride + k] = ((const float *)(column + k))[l];
#else
  UNROLL for (int k = 0; k < width; k++) p[k] = column[k];
#endif
}

/* What keep_columns left, as the rows of a table. */
static void write_kept(__global float *table, const int stride, Rows rows, const lanes *kept) {
  __global float *p = table + rows.first * stride;
#if LANES == 8
  const int numbers = rows.count * stride;
  int n = 0;
  for (; n + LANES <= numbers; n += LANES) STORE(p + n, kept[n / LANES]);
  for (; n < numbers; n++) p[n] = ((const float *)kept)[n];
#else
  UNROLL for (int n = 0; n < stride; n++) p[n] = kept[n];
#endif
}

/* A single column, which costs a read or a write for each lane: for rows too long to be held. */
static lanes read_one(__global const float *table, const int stride, int column, Rows rows) {
  __global const float *p = table + rows.first * stride + column;
#if LANES == 8
  lanes v = 0;
  UNROLL for (int l = 0; l < LANES; l++) ((float *)&v)[l] = p[(l < rows.count ? l : rows.count - 1) * stride];
  return v;
#else
  return p[0];
#endif
}

static void write_one(__global float *table, const int stride, int column, Rows rows, lanes v) {
  __global float *p = table + rows.first * stride + column;
#if LANES == 8
  UNROLL for (int l = 0; l < LANES; l++)
    if (l < rows.count) p[l * stride] = ((const float *)&v)[l];
#else
  p[0] = v;
#endif
}

/* Whole numbers are read and written as the bits that they are. */
static void read_ints(
    __global const int *table, const int stride, const int from, const int width, Rows rows, lanes_int *column)
{
#if LANES == 8
  lanes bits[4];
  read_columns((__global const float *)table, stride, from, width, rows, bits);
  UNROLL for (int k = 0; k < width; k++) column[k] = AS_INT(bits[k]);
#else
  UNROLL for (int k = 0; k < width; k++) column[k] = table[rows.first * stride + from + k];
#endif
}

static void write_ints(
    __global int *table, const int stride, const int from, const int width, Rows rows, const lanes_int *column)
{
#if LANES == 8
  lanes bits[4];
  UNROLL for (int k = 0; k < width; k++) bits[k] = AS_LANES(column[k]);
  write_columns((__global float *)table, stride, from, width, rows, bits);
#else
  UNROLL for (int k = 0; k < width; k++) table[rows.first * stride + from + k] = column[k];
#endif
}

/* A table of one column. */
static lanes read_numbers(__global const float *p, Rows rows) {
  lanes v = 0;
  read_columns(p, 1, 0, 1, rows, &v);
  return v;
}

static void write_numbers(__global float *p, Rows rows, lanes v) { write_columns(p, 1, 0, 1, rows, &v); }

/* The first three columns. */
static lanes3 read3(__global const float *table, const int stride, Rows rows) {
  lanes v[3];
  read_columns(table, stride, 0, 3, rows, v);
  return lanes3_of(v[0], v[1], v[2]);
}

static void write3(__global float *table, const int stride, Rows rows, lanes3 v) {
  lanes columns[3];
  columns[0] = v.x;
  columns[1] = v.y;
  columns[2] = v.z;
  write_columns(table, stride, 0, 3, rows, columns);
}

/* A table of one byte to a row, as whole numbers. */
static lanes_int read_bytes(__global const uchar *p, Rows rows) {
#if LANES == 8
  lanes_int v = 0;
  for (int l = 0; l < LANES; l++) ((int *)&v)[l] = p[rows.first + (l < rows.count ? l : rows.count - 1)];
  return v;
#else
  return p[rows.first];
#endif
}

static void write_bytes(__global uchar *p, Rows rows, lanes_int v) {
#if LANES == 8
  for (int l = 0; l < rows.count; l++) p[rows.first + l] = (uchar)((const int *)&v)[l];
#else
  p[rows.first] = (uchar)v;
#endif
}
