/* Sum the records that a splat left in the tiles it touches (include/raster/splat_slots.h).
 *
 *     sums[i][k] = sum over the splat's slots that are live, in their order, of records[slot][k]
 *
 * What is not live holds nothing, not even zeros, and is not read. A splat's slots are contiguous
 * and in the order of its tiles, row by row. With CONTINUED the sums go on from what is there:
 * bands of an image, one after the other, add up to the same bits as the whole. Index space:
 * splats.
 *
 * Buffers: slots[count + 1], records, live[*], sums[count, RECORD]. */

#include "include/portable.h"

#ifndef RECORD
#define RECORD 9
#endif
#ifndef CONTINUED
#define CONTINUED 0
#endif

KERNEL void splat_sum_slots(
    __global const int *restrict slots, __global const float *restrict records,
    __global const uchar *restrict live, __global float *restrict sums, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  float sum[RECORD];
  for (int k = 0; k < RECORD; k++) sum[k] = CONTINUED ? sums[i * RECORD + k] : 0;
  for (int slot = slots[i]; slot < slots[i + 1]; slot++) {
    if (!live[slot]) continue;
    for (int k = 0; k < RECORD; k++) sum[k] += records[(long)slot * RECORD + k];
  }
  for (int k = 0; k < RECORD; k++) sums[i * RECORD + k] = sum[k];
}
