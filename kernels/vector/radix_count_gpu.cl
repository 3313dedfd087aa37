/* Count the digits of every chunk of keys: the first half of a stable radix pass.
 *
 *     table[digit][chunk] = keys of the chunk that have this digit
 *
 * The prefix sum of the table tells radix_scatter_gpu where each chunk's keys of each digit begin.
 *
 * Index space: GROUP items to each chunk. See include/vector/radix.h for FIRST, and
 * include/vector/equal_keys.h for how the items count together.
 *
 * Buffers: keys[splats], slots[FIRST ? splats + 1 : 0], visible[FIRST ? 0 : 1], table[DIGITS, chunks]. */

#include "include/portable.h"
#include "include/vector/chunk.h"
#include "include/vector/equal_keys.h"
#include "include/vector/radix.h"

KERNEL void radix_count_gpu(
    __global const uint *restrict keys, __global const int *restrict slots,
    __global const long *restrict visible, __global int *restrict table,
    int splats, int chunks, int shift)
{
  __local int4 digits[GROUP_KEYS];
  __local int counters[DIGITS];
  const int chunk = GROUP_NUMBER(0), item = (int)get_local_id(0);
  if (chunk >= chunks) return;
  for (int digit = item; digit < DIGITS; digit += GROUP) counters[digit] = 0;
  const int end = CHUNK_BEGIN(chunk + 1, chunks, ELEMENTS);
  for (int first = CHUNK_BEGIN(chunk, chunks, ELEMENTS); first < end; first += GROUP) {
    const int i = first + item;
    const int digit = i < end && !LEFT_OUT(i) ? (int)DIGIT(keys[i]) : NO_KEY;
    ((__local int *)digits)[item] = digit;
    barrier(CLK_LOCAL_MEM_FENCE);
    const int2 equal = equal_keys(digits, item, digit);
    if (digit != NO_KEY && equal.x == 0) counters[digit] += equal.y;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int digit = item; digit < DIGITS; digit += GROUP)
    table[digit * chunks + chunk] = counters[digit];
}
