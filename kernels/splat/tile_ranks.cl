/* Gather what the lists need of every splat, from front to back, in one go.
 *
 *     ranks[r]  = the tiles that it touches, as tile_count wrote them
 *     owners[r] = (its first slot, splat)
 *     counts[r] = its tiles;  0 for the ranks that no visible splat has, and for rank `splats`
 *
 * The gather is the one random access to the splats; what follows reads `ranks` and `owners` in order.
 *
 * Index space: runs of `run` ranks, the last of which closes the list. SORTED 0: the splats are
 * taken in index order, and neither `order` nor `visible` is read. Where one run is all there is
 * (WHOLE 1), counts become the sums of those before.
 *
 * Buffers: spans, ranks[splats, 4], owners[splats, 2], slots, counts[splats + 1],
 * order[SORTED ? splats : 0], visible[SORTED]. */

#include "include/portable.h"

#ifndef SORTED
#define SORTED 1
#endif
#ifndef WHOLE
#define WHOLE 0
#endif

/* Ranks between the splat that is asked for and the one that is read. */
#define AHEAD 32

KERNEL void tile_ranks(
    __global const int4 *restrict spans, __global const int *restrict slots,
    __global const int *restrict order, __global const long *restrict visible,
    __global int4 *restrict ranks, __global int2 *restrict owners, __global int *restrict counts,
    int splats, int run)
{
  const long first = (long)get_global_id(0) * run;
  const long stop = first + run < splats ? first + run : splats;
  const int filled = SORTED ? (int)visible[0] : splats;
  int sum = 0;
  for (long rank = first; rank < stop; rank++) {
    int count = 0;
    if (SORTED && rank + AHEAD < filled) {
      PREFETCH(spans + order[rank + AHEAD]);
      PREFETCH(slots + order[rank + AHEAD]);
    }
    if (rank < filled) {
      const int splat = SORTED ? order[rank] : (int)rank;
      count = slots[splat + 1] - slots[splat];
      ranks[rank] = spans[splat];
      owners[rank] = (int2)(slots[splat], splat);
    }
    counts[rank] = WHOLE ? sum : count;
    sum += count;
  }
  if (first == 0) counts[splats] = WHOLE ? sum : 0;
}
