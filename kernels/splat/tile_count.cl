/* Count the tiles of every splat, and make its depth a key that sorts as an unsigned number.
 *
 *     counts[i] = tiles in the box of splat i, 0 where its depth is NaN;  counts[splats] = 0
 *     keys[i]   = the bits of its depth, flipped so that their order is that of the numbers
 *
 * The sign bit is flipped, and for negative numbers (an orthographic camera has them) all others
 * too. Both zeros have one key. Only bits are looked at: compilers fold tests for NaN away, and a
 * device may take the smallest numbers for zero.
 *
 * Index space: runs of `run` splats. Where one run is all there is (WHOLE 1), counts become the sums
 * of those before, and total[0] the sum of all.
 *
 * Buffers: boxes[splats, 4], depths, keys[splats], counts[splats + 1], total[1]. */

#include "include/portable.h"
#include "include/splat/tile_box.h"

#ifndef WHOLE
#define WHOLE 0
#endif
#if WHOLE
#define TOTAL_PARAMETER , __global long *restrict total
#else
#define TOTAL_PARAMETER
#endif

KERNEL void tile_count(
    __global const int4 *restrict boxes, __global const float *restrict depths,
    __global int *restrict counts, __global uint *restrict keys,
    int splats, int run, int tiles_x, int first_tile_row, int tiles_y TOTAL_PARAMETER)
{
  const long first = (long)get_global_id(0) * run;
  const long stop = first + run < splats ? first + run : splats;
  long sum = 0;
  for (long i = first; i < stop; i++) {
    const int4 box = clipped_box(boxes[i], tiles_x, first_tile_row, tiles_y);
    uint bits = as_uint(depths[i]);
    const int nan = (bits & 0x7fffffffu) > 0x7f800000u;
    if (bits == 0x80000000u) bits = 0;
    const int count = !nan && box.z > box.x && box.w > box.y ? (box.z - box.x) * (box.w - box.y) : 0;
    counts[i] = WHOLE ? (int)sum : count;
    sum += count;
    keys[i] = bits & 0x80000000u ? ~bits : bits | 0x80000000u;
  }
  if (first == 0) counts[splats] = WHOLE ? (int)sum : 0;
#if WHOLE
  if (first == 0) total[0] = sum;
#endif
}
