/* Convolve every detector row with one filter, in real space.
 *
 *     out[view][row][b] = gain[view] * sum over b' of h[b - b'] y[view][row][b'].
 *
 * Nothing wraps around: outside the detector a row counts as zero. `taps` holds h[-(bins-1)] ..
 * h[bins-1], then SEGMENT zeros so that the last segment may overhang.
 *
 * Index space: (segments of bins, runs of ROWS rows). Each item keeps ROWS x SEGMENT sums in
 * registers; for each b' it loads SEGMENT taps once for all rows and one number of each row. A
 * CPU is bound by its multiply-adds: ROWS * BLOCKS of them to ROWS + BLOCKS loads.
 *
 * Buffers: sinogram, filtered[rows, bins], taps[bins - 1 + (bins + SEGMENT - 1) / SEGMENT * SEGMENT],
 * gains[(rows + rows_per_view - 1) / rows_per_view]. */

#include "include/portable.h"

#ifndef BLOCKS
#define BLOCKS (LANES == 8 ? 2 : 1)
#endif
#ifndef ROWS
#define ROWS (LANES == 8 ? 4 : 1)
#endif
#define SEGMENT (LANES * BLOCKS)

KERNEL void filter_views(
    __global const real *restrict sinogram, __global real *restrict filtered,
    __global const real *restrict taps, __global const real *restrict gains,
    int rows, int rows_per_view, int bins)
{
  const int b = (int)get_global_id(0) * SEGMENT, row0 = (int)get_global_id(1) * ROWS;
  if (b >= bins) return;
  __global const real *y[ROWS];
  lanes sum[ROWS][BLOCKS];
  UNROLL for (int i = 0; i < ROWS; i++) {
    /* Rows past the end repeat the last one and are not stored. */
    const int row = row0 + i < rows ? row0 + i : rows - 1;
    y[i] = sinogram + (long)row * bins;
    UNROLL for (int n = 0; n < BLOCKS; n++) sum[i][n] = 0;
  }
  __global const real *h = taps + (bins - 1) + b;
  for (int source = 0; source < bins; source++, h--) {
    lanes tap[BLOCKS];
    UNROLL for (int n = 0; n < BLOCKS; n++) tap[n] = LOAD(h + n * LANES);
    UNROLL for (int i = 0; i < ROWS; i++) {
      const real value = y[i][source];
      UNROLL for (int n = 0; n < BLOCKS; n++) sum[i][n] = sum[i][n] + value * tap[n];
    }
  }
  for (int i = 0; i < ROWS && row0 + i < rows; i++) {
    const int row = row0 + i;
    __global real *out = filtered + (long)row * bins + b;
    lanes values[BLOCKS];
    UNROLL for (int n = 0; n < BLOCKS; n++) values[n] = gains[row / rows_per_view] * sum[i][n];
    for (int n = 0; n < SEGMENT && b + n < bins; n++) out[n] = ((const real *)values)[n];
  }
}
