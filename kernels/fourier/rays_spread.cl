/* Rays to the regular grid of frequencies: backprojection's inner loop (see
 * include/fourier/fourier_rays.h).
 *
 *     grid[y][x] = sum over samples of phi(x - px) phi(y - py) ray[l],      p = l * step,
 *
 * over both halves of every ray; the half that is not stored is the conjugate of the other. Of the
 * grid, the half x >= 0 is made, in tiles. A work-item gathers what falls on its tile: `starts` says
 * which visits are the tile's. A visit is the tile at one of the places where the periodic grid
 * repeats it, and the rays that cross it there, `count` of them from `first` on in the order of
 * their angle. No two items write the same cell: no atomics, and one order of summation.
 *
 * Index space: tiles. A CPU sums in an array of its own, whose rows have room for a kernel that
 * overhangs the tile.
 *
 * Buffers: rays[2, count, samples],
 * grid[2, rows, LANES == 8 ? (width + 2 * LANES - 1) / (2 * LANES) * (2 * LANES) : columns],
 * table[(1 << LOG2_ROWS) + 1, TABLE_PITCH], steps, inverses[count, 2], ends[count], visits[*],
 * starts[tiles + 1]. */

#include "include/portable.h"
#include "include/fourier/fourier_rays.h"

#ifndef TILE
#define TILE (LANES == 8 ? 32 : 4)
#endif
#include "include/fourier/ray_span.h"

#if LANES == 8
#define OVERHANG TABLE_PITCH
#define ADD(p, v) { lane_sum *sum_at = (lane_sum *)(p); *sum_at = *sum_at + (v); }
#define SUM_AT(p) (*(lane_sum *)(p))
typedef float8 lane_sum __attribute__((aligned(4)));
#define INSIDE(x) 1
#else
#define OVERHANG 0
#define ADD(p, v) *(p) += (v);
#define SUM_AT(p) (*(p))
#define INSIDE(x) ((uint)(x) < TILE)
#endif
#define ACROSS (TILE + 2 * OVERHANG)
#define CELLS (ACROSS * ACROSS)

KERNEL void rays_spread(
    __global const float *restrict rays, __global float *restrict grid,
    __global const float *restrict table, __global const long2 *restrict steps,
    __global const float2 *restrict inverses, __global const int *restrict ends,
    __global const int4 *restrict visits, __global const int *restrict starts, int count, int samples,
    int tiles, int across, int width, int rows, int columns)
{
  const int tile = (int)get_global_id(0);
  if (tile >= tiles) return;
  float re[CELLS], im[CELLS];
  for (int n = 0; n < CELLS; n++) re[n] = im[n] = 0;
  for (int v = starts[tile]; v < starts[tile + 1]; v++) {
    const int4 visit = visits[v];
    for (int n = visit.z; n < visit.z + visit.w; n++) {
      const int ray = n < count ? n : n - count;
      const span near = samples_near(visit, inverses[ray], ends[ray]);
      const long step_x = steps[ray].x, step_y = steps[ray].y;
      long px = near.first * step_x - ((long)visit.x << 32), py = near.first * step_y - ((long)visit.y << 32);
      __global const float *values = rays + (long)ray * samples;
      for (int l = near.first; l <= near.last; l++, px += step_x, py += step_y) {
        const int x = first_cell(px), y = first_cell(py);
        if (!REACHES(x, y)) continue;
        const int m = l < 0 ? -l : l;
        const float qr = values[m], qi = values[(long)count * samples + m];
        const float pr = qr, pi = l < 0 ? -qi : qi;
        lane_array down[TABLE_PITCH / LANES];
        const uint fraction_x = offset_of(px), fraction_y = offset_of(py);
        UNROLL for (int k = 0; k < TABLE_PITCH; k += LANES)
          down[k / LANES].vector = weights_at(table, fraction_y, k);
        UNROLL for (int k = 0; k < WIDTH; k += LANES) {
          if (!INSIDE(x + k)) continue;
          const lanes w = weights_at(table, fraction_x, k), wr = pr * w, wi = pi * w;
          UNROLL for (int r = 0; r < WIDTH; r++) {
            if (!INSIDE(y + r)) continue;
            const int at = (OVERHANG + y + r) * ACROSS + OVERHANG + x + k;
            const float d = down[r / LANES].number[r % LANES];
            ADD(re + at, d * wr)
            ADD(im + at, d * wi)
          }
        }
      }
    }
  }
  const int x0 = tile % across * TILE, y0 = tile / across * TILE;
  for (int r = 0; r < TILE && y0 + r < rows; r++)
    for (int k = 0; k < TILE && x0 + k < width; k += LANES) {
      const int at = (OVERHANG + r) * ACROSS + OVERHANG + k;
      STORE(grid + cell_at(0, y0 + r, x0 + k, rows, columns), SUM_AT(re + at));
      STORE(grid + cell_at(1, y0 + r, x0 + k, rows, columns), SUM_AT(im + at));
    }
}
