/* Columns of the grid are transformed back and folded to pairs of image rows, for CPUs.
 *
 * What a GPU does by fft_pass and spectrum_fold_gpu, BLOCK frequencies at a time in the caches of a core
 * (see include/fourier/row_pairs.h). The grid comes in blocks (cell_at), and is overwritten; pairs
 * leave in blocks of BLOCK as well, each with its real parts and then its imaginary ones, (edge,
 * BLOCK).
 *
 * Index space: items, each of which takes every so many-th block.
 *
 * Buffers: grid[blocks, 2, length, BLOCK], fields[(pairs + BLOCK - 1) / BLOCK, 2, edge, BLOCK],
 * scratch[items, 4, length, BLOCK], turns[length, 2]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fft_block.h"
#include "include/fourier/fourier_rays.h"
#include "include/fourier/row_pairs.h"

KERNEL void pairs_of_spectrum_cpu(
    __global float *grid, __global float *fields, int height, int middle, int edge, int pairs,
    __global float *scratch, __global const float *restrict turns, int length, int blocks, int items)
{
  const int item = (int)get_global_id(0);
  if (item >= items) return;
  const block spare[2] = BLOCKS_OF(item, scratch, length);
  const long part = (long)length * BLOCK, pair_part = (long)edge * BLOCK;
  for (int n = item; n < blocks; n += items) {
    const block columns = {grid + 2 * n * part, grid + (2 * n + 1) * part};
    const block both[2] = {columns, spare[0]};
    const block z = both[transform_block_back(both, turns, length)];
    for (int c = 0; c < pairs; c += LANES) {
      __global float *zr = fields + 2 * (c / BLOCK) * pair_part + c % BLOCK, *zi = zr + pair_part;
      for (int x = 0; x < BLOCK; x += LANES)
        fold_pairs(
            z.re + x, z.im + x, BLOCK, length, zr, zi, BLOCK, edge, n * BLOCK + x, c, pairs, height, middle);
    }
  }
}
