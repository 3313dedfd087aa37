/* Convolve rows of a detector by their transforms, BLOCK rows at a time, for CPUs.
 *
 * What a GPU does by rows_pack_gpu, fft_pass, rows_weigh_gpu, fft_pass and rows_unpack_gpu, all in the caches of a
 * core (see include/tomo/row_columns.h). Index space: items, each of which takes every so many-th
 * block.
 *
 * Buffers: rows, out[count, bins], gains[(count + rows_per_view - 1) / rows_per_view], sums,
 * differences[length / 2 + 1, filters], half_turns[length / 2 + 1, 2], scratch[items, 4, length, BLOCK],
 * turns[length, 2]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/tomo/row_columns.h"
#include "include/fourier/fft_block.h"

KERNEL void rows_filter_cpu(
    __global const real *restrict rows, __global real *restrict out, __global const real *restrict gains,
    __global const real *restrict sums, __global const real *restrict differences,
    __global const real *restrict half_turns, int count, int rows_per_view, int filters, int bins,
    __global real *scratch, __global const real *restrict turns, int length, int blocks, int items)
{
  const int item = (int)get_global_id(0);
  if (item >= items) return;
  const block mine[2] = BLOCKS_OF(item, scratch, length);
  for (int n = item; n < blocks; n += items) {
    for (int c = 0; c < BLOCK; c += LANES)
      pack_rows(rows, mine[0].re + c, mine[0].im + c, BLOCK, n * BLOCK + c, count, bins, 0, 2 * length);
    const int at = transform_block(mine, turns, length);
    for (int c = 0; c < BLOCK; c += LANES) {
      int index[LANES];
      filters_of(n * BLOCK + c, rows_per_view, filters, index);
      for (int k = 0; k <= length / 2; k++)
        weigh_rows(
            mine[at].re + c, mine[at].im + c, BLOCK, k, length, sums, differences, half_turns, filters, index);
    }
    const block turned_over[2] = {mine[at], mine[1 - at]};
    const block result = turned_over[transform_block_back(turned_over, turns, length)];
    for (int c = 0; c < BLOCK; c += LANES)
      unpack_rows(
          result.re + c, result.im + c, BLOCK, out, gains, n * BLOCK + c, count, rows_per_view, bins, 0, bins);
  }
}
