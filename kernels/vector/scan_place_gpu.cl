/* Replace whole numbers by the sum of all before them: the way down of a prefix sum.
 *
 *     values[i] = sum of values[0] .. values[i - 1]
 *
 * A group goes through one run, from the sum of all runs before it: sums[run's number]. Where one
 * run is all there is (WHOLE 1), it starts from zero and leaves the total in sums[0]. An item takes
 * EACH numbers at a time, and the group adds up what its items have.
 *
 * Index space: GROUP items to each run. WIDE 1: the values have 64 bits.
 *
 * Buffers: values[count], sums[WHOLE ? 1 : (count + run - 1) / run]. */

#include "include/portable.h"
#include "include/vector/group_sum.h"
#include "include/vector/scan_number.h"

#ifndef WHOLE
#define WHOLE 0
#endif
#define EACH 16

KERNEL void scan_place_gpu(
    __global number *restrict values, __global long *restrict sums, int count, int run)
{
  __local long partial[GROUP];
  const int item = (int)get_local_id(0);
  const long first = (long)GROUP_NUMBER(0) * run;
  const long stop = first + run < count ? first + run : count;
  if (first >= count) return;
  long before = WHOLE ? 0 : sums[GROUP_NUMBER(0)];
  for (long begin = first; begin < stop; begin += GROUP * EACH) {
    const long from = begin + item * EACH;
    number own[EACH];
    long sum = 0, all;
    for (int k = 0; k < EACH; k++) {
      own[k] = from + k < stop ? values[from + k] : 0;
      sum += own[k];
    }
    long place = before + sum_before(partial, item, sum, &all);
    for (int k = 0; k < EACH && from + k < stop; k++) {
      values[from + k] = (number)place;
      place += own[k];
    }
    before += all;
  }
  if (WHOLE && item == 0) sums[0] = before;
}
