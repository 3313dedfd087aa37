/* Rays read from the regular grid of frequencies: the transpose of rays_spread.
 *
 *     ray[l] = sum over cells of phi(x - px) phi(y - py) grid[y][x],      p = l * step.
 *
 * Rays point to the right. A sample beyond the grid's last frequency is found where the periodic
 * grid repeats it, if need be in the conjugate half. Rows carry cells before zero and behind the
 * last frequency (spectrum_mirror), so that a kernel never leaves its row.
 *
 * Index space: runs of RUN samples and rays. Neighbouring items of a GPU take neighbouring samples, so
 * that their stores are one; a CPU takes one run of all rays in turn, which lie in the same part of
 * the grid.
 *
 * Buffers: grid[2, rows, columns], rays[2, count, samples], table[(1 << LOG2_ROWS) + 1, TABLE_PITCH],
 * steps[count, 2], ends[count]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"

#ifndef RUN
#define RUN (LANES == 8 ? 64 : 1)
#endif
#define RAY_AXIS (LANES == 8 ? 0 : 1)
#define RUN_AXIS (1 - RAY_AXIS)

KERNEL void rays_read(
    __global const float *restrict grid, __global float *restrict rays,
    __global const float *restrict table, __global const long2 *restrict steps, __global const int *restrict ends,
    int count, int samples, int rows, int columns, int edge)
{
  const int ray = (int)get_global_id(RAY_AXIS), begin = (int)get_global_id(RUN_AXIS) * RUN;
  const int end = begin + RUN < samples ? begin + RUN : samples;
  const long period_x = (long)edge << 32, period_y = (long)rows << 32;
  __global float *out = rays + (long)ray * samples;
  const int kept = end < ends[ray] ? end : ends[ray];
  for (int l = kept > begin ? kept : begin; l < end; l++) out[l] = out[(long)count * samples + l] = 0;
  for (int l = begin; l < kept; l++) {
    long px = l * steps[ray].x, py = l * steps[ray].y;
    while (px > period_x) px -= period_x;
    const int mirrored = px > period_x / 2;
    if (mirrored) { px = period_x - px; py = -py; }
    const int x = first_cell(px);
    int y = first_cell(py);
    while (y < 0) y += rows;
    while (y >= rows) y -= rows;
    const uint fraction_x = offset_of(px), fraction_y = offset_of(py);
    lane_array down[TABLE_PITCH / LANES];
    UNROLL for (int k = 0; k < TABLE_PITCH; k += LANES)
      down[k / LANES].vector = weights_at(table, fraction_y, k);
    lanes re = 0, im = 0;
    UNROLL for (int k = 0; k < WIDTH; k += LANES) {
      lanes sum_r = 0, sum_i = 0;
      UNROLL for (int r = 0; r < WIDTH; r++) {
        const int row = y + r < rows ? y + r : y + r - rows;
        __global const float *cells = grid + (long)row * columns + MARGIN + x + k;
        const float d = down[r / LANES].number[r % LANES];
        sum_r = sum_r + d * LOAD(cells);
        sum_i = sum_i + d * LOAD(cells + (long)rows * columns);
      }
      const lanes w = weights_at(table, fraction_x, k);
      re = re + w * sum_r;
      im = im + w * sum_i;
    }
    const float sum = SUM_OF_LANES(im);
    out[l] = SUM_OF_LANES(re);
    out[(long)count * samples + l] = mirrored ? -sum : sum;
  }
}
