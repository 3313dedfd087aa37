/* Move every key and its splat to its place by one digit: the second half of a stable radix pass.
 *
 * `table` is the prefix sum of what radix_count_cpu counted. Chunks keep their order and so do the
 * keys within one, so that equal digits stay in the order of the list.
 *
 * Index space: chunks. See include/vector/radix.h for FIRST; in the first pass a
 * splat is its own place in the list, and `order` is not read.
 *
 * Buffers: keys, moved_keys, moved_order[splats], order[FIRST ? 0 : splats], slots[FIRST ? splats + 1 : 0],
 * visible[FIRST ? 0 : 1], table[DIGITS, chunks]. */

#include "include/portable.h"
#include "include/vector/chunk.h"
#include "include/vector/radix.h"

KERNEL void radix_scatter_cpu(
    __global const uint *restrict keys, __global const int *restrict order,
    __global uint *restrict moved_keys, __global int *restrict moved_order,
    __global const int *restrict slots, __global const long *restrict visible,
    __global const int *restrict table, int splats, int chunks, int shift)
{
  int places[DIGITS];
  const int chunk = (int)get_global_id(0);
  if (chunk >= chunks) return;
  for (int digit = 0; digit < DIGITS; digit++) places[digit] = table[digit * chunks + chunk];
  const int end = CHUNK_BEGIN(chunk + 1, chunks, ELEMENTS);
  for (int i = CHUNK_BEGIN(chunk, chunks, ELEMENTS); i < end; i++) {
    if (LEFT_OUT(i)) continue;
    const uint key = keys[i];
    const int place = places[DIGIT(key)]++;
    moved_keys[place] = key;
    moved_order[place] = FIRST ? i : order[i];
  }
}
