/* Count the digits of every chunk of keys: the first half of a stable radix pass.
 *
 *     table[digit][chunk] = keys of the chunk that have this digit
 *
 * The prefix sum of the table tells radix_scatter_cpu where each chunk's keys of each digit begin.
 *
 * Index space: chunks. See include/vector/radix.h for FIRST.
 *
 * Buffers: keys[splats], slots[FIRST ? splats + 1 : 0], visible[FIRST ? 0 : 1], table[DIGITS, chunks]. */

#include "include/portable.h"
#include "include/vector/chunk.h"
#include "include/vector/radix.h"

KERNEL void radix_count_cpu(
    __global const uint *restrict keys, __global const int *restrict slots,
    __global const long *restrict visible, __global int *restrict table,
    int splats, int chunks, int shift)
{
  int counters[DIGITS];
  const int chunk = (int)get_global_id(0);
  if (chunk >= chunks) return;
  for (int digit = 0; digit < DIGITS; digit++) counters[digit] = 0;
  const int end = CHUNK_BEGIN(chunk + 1, chunks, ELEMENTS);
  for (int i = CHUNK_BEGIN(chunk, chunks, ELEMENTS); i < end; i++)
    if (!LEFT_OUT(i)) counters[DIGIT(keys[i])]++;
  for (int digit = 0; digit < DIGITS; digit++) table[digit * chunks + chunk] = counters[digit];
}
