/* Number slots anew, without those that nothing is seen of.
 *
 *     numbers[i * STRIDE + STRIDE - 1] = before[that number]
 *
 * `before` is how many slots before each are seen. Index space: runs of `run` numbers.
 *
 * Buffers: numbers[count, STRIDE], before[*]. */

#include "include/portable.h"

#ifndef STRIDE
#define STRIDE 1
#endif

KERNEL void slot_number(
    __global int *restrict numbers, __global const int *restrict before, int count, int run)
{
  const long first = (long)get_global_id(0) * run;
  const long stop = first + run < count ? first + run : count;
  for (long i = first; i < stop; i++) {
    __global int *number = numbers + i * STRIDE + STRIDE - 1;
    *number = before[*number];
  }
}
