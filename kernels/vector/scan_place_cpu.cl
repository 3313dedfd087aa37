/* Replace whole numbers by the sum of all before them: the way down of a prefix sum.
 *
 *     values[i] = sum of values[0] .. values[i - 1]
 *
 * Each item goes through one run, from the sum of all runs before it: sums[run's number]. Where
 * one run is all there is (WHOLE 1), it starts from zero and leaves the total in sums[0].
 *
 * Index space: runs. WIDE 1: the values have 64 bits.
 *
 * Buffers: values[count], sums[WHOLE ? 1 : (count + run - 1) / run]. */

#include "include/portable.h"
#include "include/vector/scan_number.h"

#ifndef WHOLE
#define WHOLE 0
#endif

KERNEL void scan_place_cpu(
    __global number *restrict values, __global long *restrict sums, int count, int run)
{
  const long first = (long)get_global_id(0) * run;
  const long stop = first + run < count ? first + run : count;
  if (first >= count) return;
  long sum = WHOLE ? 0 : sums[get_global_id(0)];
  for (long i = first; i < stop; i++) {
    const number value = values[i];
    values[i] = (number)sum;
    sum += value;
  }
  if (WHOLE) sums[0] = sum;
}
