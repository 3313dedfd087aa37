/* Sum runs of whole numbers: the way up of a prefix sum (the way down is scan_place_cpu).
 *
 *     sums[r] = sum of values[r * run] .. values[r * run + run - 1]
 *
 * The sums have 64 bits, so that the last of them tells a total that 32 bits cannot hold.
 *
 * Index space: runs. WIDE 1: the values are themselves such sums.
 *
 * Buffers: values[count], sums[(count + run - 1) / run]. */

#include "include/portable.h"
#include "include/vector/scan_number.h"

KERNEL void scan_sum_cpu(
    __global const number *restrict values, __global long *restrict sums, int count, int run)
{
  const long first = (long)get_global_id(0) * run;
  const long stop = first + run < count ? first + run : count;
  if (first >= count) return;
  long sum = 0;
  for (long i = first; i < stop; i++) sum += values[i];
  sums[get_global_id(0)] = sum;
}
