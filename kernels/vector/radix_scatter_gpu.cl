/* Move every key and its splat to its place by one digit: the second half of a stable radix pass.
 *
 * `table` is the prefix sum of what radix_count_gpu counted. Chunks keep their order and so do the
 * keys within one, so that equal digits stay in the order of the list.
 *
 * Index space: GROUP items to each chunk. See include/vector/radix.h for FIRST, and
 * include/vector/equal_keys.h for how the items find their places; in the first pass a splat is its
 * own place in the list, and `order` is not read.
 *
 * Buffers: keys, moved_keys, moved_order[splats], order[FIRST ? 0 : splats], slots[FIRST ? splats + 1 : 0],
 * visible[FIRST ? 0 : 1], table[DIGITS, chunks]. */

#include "include/portable.h"
#include "include/vector/chunk.h"
#include "include/vector/equal_keys.h"
#include "include/vector/radix.h"

KERNEL void radix_scatter_gpu(
    __global const uint *restrict keys, __global const int *restrict order,
    __global uint *restrict moved_keys, __global int *restrict moved_order,
    __global const int *restrict slots, __global const long *restrict visible,
    __global const int *restrict table, int splats, int chunks, int shift)
{
  __local int4 digits[GROUP_KEYS];
  __local int places[DIGITS];
  const int chunk = GROUP_NUMBER(0), item = (int)get_local_id(0);
  if (chunk >= chunks) return;
  for (int digit = item; digit < DIGITS; digit += GROUP)
    places[digit] = table[digit * chunks + chunk];
  const int end = CHUNK_BEGIN(chunk + 1, chunks, ELEMENTS);
  for (int first = CHUNK_BEGIN(chunk, chunks, ELEMENTS); first < end; first += GROUP) {
    const int i = first + item;
    const bool listed = i < end && !LEFT_OUT(i);
    const uint key = listed ? keys[i] : 0;
    const int digit = listed ? (int)DIGIT(key) : NO_KEY;
    ((__local int *)digits)[item] = digit;
    barrier(CLK_LOCAL_MEM_FENCE);
    const int2 equal = equal_keys(digits, item, digit);
    const int place = listed ? places[digit] : 0;
    if (listed) {
      moved_keys[place + equal.x] = key;
      moved_order[place + equal.x] = FIRST ? i : order[i];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (listed && equal.x == 0) places[digit] = place + equal.y;
  }
}
