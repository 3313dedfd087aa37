/* Rays of several slices to their grids of frequencies at once, for CPUs (see rays_spread.cl).
 *
 * Slices of a stack have their rays at the same places, so that a sample's weights are made once for
 * all of them. The lanes are real and imaginary parts of four slices; the same numbers are
 * multiplied and added in the same order as for a slice alone, which gets the same bits. With fewer
 * than four SLICES the pointers behind them may be any, and what is there stays as it is.
 *
 * Index space: tiles.
 *
 * Buffers: rays0, rays1, rays2, rays3[2, count, samples],
 * grid0[2, rows, (width + BLOCK - 1) / BLOCK * BLOCK],
 * grid1[SLICES > 1 ? 2 : 0, rows, (width + BLOCK - 1) / BLOCK * BLOCK],
 * grid2[SLICES > 2 ? 2 : 0, rows, (width + BLOCK - 1) / BLOCK * BLOCK],
 * grid3[SLICES > 3 ? 2 : 0, rows, (width + BLOCK - 1) / BLOCK * BLOCK],
 * table[(1 << LOG2_ROWS) + 1, TABLE_PITCH], steps, inverses[count, 2], ends[count], visits[*],
 * starts[tiles + 1]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef SLICES
#define SLICES 4
#endif
#include "include/fourier/ray_span.h"

#define OVERHANG (WIDTH - 1)
#define ACROSS (TILE + 2 * OVERHANG)

KERNEL void rays_spread_stack_cpu(
    __global const float *restrict rays0, __global const float *restrict rays1,
    __global const float *restrict rays2, __global const float *restrict rays3,
    __global float *grid0, __global float *grid1, __global float *grid2, __global float *grid3,
    __global const float *restrict table, __global const long2 *restrict steps,
    __global const float2 *restrict inverses, __global const int *restrict ends,
    __global const int4 *restrict visits, __global const int *restrict starts, int count, int samples,
    int tiles, int across, int width, int rows, int columns)
{
  const int tile = (int)get_global_id(0);
  if (tile >= tiles) return;
  real8 sums[ACROSS * ACROSS];
  for (int n = 0; n < ACROSS * ACROSS; n++) sums[n] = 0;
  for (int v = starts[tile]; v < starts[tile + 1]; v++) {
    const int4 visit = visits[v];
    for (int n = visit.z; n < visit.z + visit.w; n++) {
      const int ray = n < count ? n : n - count;
      const span near = samples_near(visit, inverses[ray], ends[ray]);
      const long step_x = steps[ray].x, step_y = steps[ray].y;
      long px = near.first * step_x - ((long)visit.x << 32), py = near.first * step_y - ((long)visit.y << 32);
      for (int l = near.first; l <= near.last; l++, px += step_x, py += step_y) {
        const int x = first_cell(px), y = first_cell(py);
        if (!REACHES(x, y)) continue;
        const long m = (long)ray * samples + (l < 0 ? -l : l), i = m + (long)count * samples;
        const float sign = l < 0 ? -1.0f : 1.0f;
        const real8 value = (real8)(
            rays0[m], rays1[m], rays2[m], rays3[m],
            sign * rays0[i], sign * rays1[i], sign * rays2[i], sign * rays3[i]);
        lane_array down, along;
        down.vector = weights_at(table, offset_of(py), 0);
        along.vector = weights_at(table, offset_of(px), 0);
        real8 weighted[WIDTH];
        UNROLL for (int k = 0; k < WIDTH; k++) weighted[k] = value * along.number[k];
        real8 *cell = sums + (OVERHANG + y) * ACROSS + OVERHANG + x;
        UNROLL for (int r = 0; r < WIDTH; r++) {
          const float d = down.number[r];
          UNROLL for (int k = 0; k < WIDTH; k++)
            cell[r * ACROSS + k] = cell[r * ACROSS + k] + d * weighted[k];
        }
      }
    }
  }
  const int x0 = tile % across * TILE, y0 = tile / across * TILE;
  for (int r = 0; r < TILE && y0 + r < rows; r++)
    for (int k = 0; k < TILE && x0 + k < width; k += LANES) {
      lanes block[LANES];
      UNROLL for (int n = 0; n < LANES; n++) block[n] = sums[(OVERHANG + r) * ACROSS + OVERHANG + k + n];
      TRANSPOSE(block)
      UNROLL for (int part = 0; part < 2; part++) {
        const long at = cell_at(part, y0 + r, x0 + k, rows, columns);
        STORE(grid0 + at, block[4 * part]);
        if (SLICES > 1) STORE(grid1 + at, block[4 * part + 1]);
        if (SLICES > 2) STORE(grid2 + at, block[4 * part + 2]);
        if (SLICES > 3) STORE(grid3 + at, block[4 * part + 3]);
      }
    }
}
