/* Sum runs of whole numbers: the way up of a prefix sum (the way down is scan_place_gpu).
 *
 *     sums[r] = sum of values[r * run] .. values[r * run + run - 1]
 *
 * The sums have 64 bits, so that the last of them tells a total that 32 bits cannot hold.
 *
 * Index space: GROUP items to each run, who take its numbers in turns. WIDE 1: the values are
 * themselves such sums.
 *
 * Buffers: values[count], sums[(count + run - 1) / run]. */

#include "include/portable.h"
#include "include/vector/group_sum.h"
#include "include/vector/scan_number.h"

KERNEL void scan_sum_gpu(
    __global const number *restrict values, __global long *restrict sums, int count, int run)
{
  __local long partial[GROUP];
  const int item = (int)get_local_id(0);
  const long first = (long)GROUP_NUMBER(0) * run;
  const long stop = first + run < count ? first + run : count;
  if (first >= count) return;
  long sum = 0, all;
  for (long i = first + item; i < stop; i += GROUP) sum += values[i];
  sum_before(partial, item, sum, &all);
  if (item == 0) sums[GROUP_NUMBER(0)] = all;
}
