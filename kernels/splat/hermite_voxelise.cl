/* Sum splats at the voxels of a grid: the density that people look at as slices.
 *
 *     volume(z, y, x) = sum over splats with |u| <= REACH of P(u) exp(-|u|^2 / 2),
 *
 * u = U^-1 (voxel - mean) and P a polynomial of order ORDER, both as hermite_dilate.cl wrote them. U is
 * upper triangular, so u_2 belongs to a slice, u_1 to a row, and u_0 alone to a voxel:
 *
 *     u_2 = dz / U_22,     u_1 = (dy - U_12 u_2) / U_11,     u_0 = (dx - U_01 u_1 - U_02 u_2) / U_00.
 *
 * Horner's rule puts u_2 into P once for a slice of a brick, u_1 once for a row of it, and leaves
 * ORDER products for a voxel. What cancels between powers up to order 8 the Gaussian makes small.
 *
 * The grid is cut into bricks. `entries` list the splats whose boxes touch a brick, as places in
 * `chosen`, brick after brick (rows of bricks along x from first_row on, all of one layer), always
 * in the same order: sums are repeatable to the bit. Places are whole voxels and a rest, whose
 * difference from a voxel is exact before anything is rounded, wherever the splat is.
 *
 * Index space: items of bricks. An item owns a block of BLOCK_X strips of LANES voxels, BLOCK_Y
 * rows and BLOCK_Z slices: a whole brick on a CPU, some voxels in a row on a GPU, where the items
 * of a brick walk its list together.
 *
 * Buffers: volume[nz, ny, nx], table, chosen, entries[*], starts[bricks + 1]. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/projection/hermite_space.h"
#include "include/raster/hermite_edge.h"

#define REACH HERMITE_EDGE(ORDER)
#define SHAPE_NUMBERS 12
#define WIDTH (SHAPE_NUMBERS + MODES)
#define PLANE_MODES ((ORDER + 1) * (ORDER + 2) / 2)

#ifndef BRICK_X
#define BRICK_X 16
#define BRICK_Y 8
#define BRICK_Z 8
#endif
#if LANES == 8
#define BLOCK_X (BRICK_X / LANES)
#define BLOCK_Y BRICK_Y
#define BLOCK_Z BRICK_Z
#else
#define BLOCK_X 4
#define BLOCK_Y 1
#define BLOCK_Z 1
#endif
#define ITEMS_X (BRICK_X / (BLOCK_X * LANES))
#define ITEMS_Y (BRICK_Y / BLOCK_Y)
#define ITEMS_Z (BRICK_Z / BLOCK_Z)
#define ITEMS (ITEMS_X * ITEMS_Y * ITEMS_Z)
/* exp(-v / 2) = 2^(TO_POWER v) */
#define TO_POWER -0.72134752f

/* Add a splat to a row of a block, whose first voxel is at u_0 = begin; `step` is that of u_0 from
 * voxel to voxel, `line` are the coefficients of powers of u_0, highest first. */
static void add_to_row(lanes *sums, const float *line, float begin, float step, float rest) {
  const lanes first = step * LANE_NUMBERS + begin;
  UNROLL for (int strip = 0; strip < BLOCK_X; strip++) {
    const float low = begin + strip * LANES * step, high = low + (LANES - 1) * step;
    /* The nearest voxel of the strip: where it is beyond reach all are. */
    const float nearest = low > 0 ? low : high < 0 ? high : 0;
    if (!(nearest * nearest + rest <= REACH * REACH)) continue;
    const lanes u = first + strip * LANES * step, square = u * u + rest;
    lanes sum = line[0];
    UNROLL for (int k = 1; k <= ORDER; k++) sum = sum * u + line[k];
    const lanes value = sum * power_of_two(TO_POWER * square);
    sums[strip] += square <= REACH * REACH ? value : 0;
  }
}

/* Put u_2 into the polynomial: coefficients of u_0^a u_1^b, a falling, within it b falling. */
static void to_slice(float *slice, __global const float *powers, float u) {
  int term = 0, k = 0;
  UNROLL for (int a = ORDER; a >= 0; a--)
    UNROLL for (int b = ORDER - a; b >= 0; b--) {
      float sum = powers[term++];
      UNROLL for (int c = ORDER - a - b; c > 0; c--) sum = sum * u + powers[term++];
      slice[k++] = sum;
    }
}

/* Put u_1 into what is left: coefficients of u_0^a, a falling. */
static void to_line(float *line, const float *slice, float u) {
  int term = 0;
  UNROLL for (int a = ORDER; a >= 0; a--) {
    float sum = slice[term++];
    UNROLL for (int b = ORDER - a; b > 0; b--) sum = sum * u + slice[term++];
    line[ORDER - a] = sum;
  }
}

/* Of the whole numbers 0 to most - 1 the first that is not below `low`, and one past the last that is
 * not above `high`; none where these are no numbers. */
static int first_within(float low, int most) {
  const int whole = (int)low;
  return !(low > 0) ? 0 : low >= most ? most : whole < low ? whole + 1 : whole;
}

static int past_within(float high, int most) { return !(high >= 0) ? 0 : high >= most ? most : (int)high + 1; }

static void add_splat(lanes *sums, __global const float *row, int x0, int y0, int z0, int slices, int lines) {
  const float x = (row[6] - (float)x0) + row[9], y = (row[7] - (float)y0) + row[10];
  const float z = (row[8] - (float)z0) + row[11], deep = REACH / row[2], tall = 1 / row[1];
  const int back = past_within(z + deep, slices);
  float slice[PLANE_MODES], line[ORDER + 1];
  for (int k = first_within(z - deep, slices); k < back; k++) {
    const float u2 = row[2] * ((float)k - z), middle = y + row[5] * u2, left = REACH * REACH - u2 * u2;
    if (!(left > 0)) continue;
    const float half_side = tall * sqrt(left);
    const int bottom = past_within(middle + half_side, lines);
    to_slice(slice, row + SHAPE_NUMBERS, u2);
    for (int j = first_within(middle - half_side, lines); j < bottom; j++) {
      const float u1 = row[1] * ((float)j - middle), rest = u1 * u1 + u2 * u2;
      to_line(line, slice, u1);
      add_to_row(sums + (k * BLOCK_Y + j) * BLOCK_X, line, -row[0] * (x + row[3] * u1 + row[4] * u2), row[0], rest);
    }
  }
}

static int least(int a, int b) { return a < b ? a : b; }

KERNEL void hermite_voxelise(
    __global float *restrict volume, __global const float *restrict table, __global const int *restrict chosen,
    __global const int2 *restrict entries, __global const int *restrict starts,
    int nz, int ny, int nx, int bricks_x, int first_row, int layer, int bricks)
{
  const int brick = (int)(get_global_id(0) / ITEMS), item = (int)(get_global_id(0) % ITEMS);
  const int x0 = brick % bricks_x * BRICK_X + item % ITEMS_X * (BLOCK_X * LANES);
  const int y0 = (brick / bricks_x + first_row) * BRICK_Y + item / ITEMS_X % ITEMS_Y * BLOCK_Y;
  const int z0 = layer * BRICK_Z + item / (ITEMS_X * ITEMS_Y) * BLOCK_Z;
  if (brick >= bricks || x0 >= nx || y0 >= ny || z0 >= nz) return;
  const int slices = least(BLOCK_Z, nz - z0), lines = least(BLOCK_Y, ny - y0);
  lanes sums[BLOCK_Z * BLOCK_Y * BLOCK_X];
  for (int k = 0; k < BLOCK_Z * BLOCK_Y * BLOCK_X; k++) sums[k] = 0;
  for (int entry = starts[brick]; entry < starts[brick + 1]; entry++)
    add_splat(sums, table + (long)WIDTH * chosen[entries[entry].x], x0, y0, z0, slices, lines);
  for (int z = 0; z < slices; z++)
    for (int y = 0; y < lines; y++)
      for (int strip = 0; strip < BLOCK_X; strip++) {
        const int x = x0 + strip * LANES;
        const float *values = (const float *)&sums[(z * BLOCK_Y + y) * BLOCK_X + strip];
        __global float *out = volume + ((long)(z0 + z) * ny + y0 + y) * nx + x;
        for (int lane = 0; lane < LANES && x + lane < nx; lane++) out[lane] = values[lane];
      }
}
