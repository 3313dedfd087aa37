/* A sliding median across detector bins, of values of one rank (or one view).
 *
 *     out[row][bin][k] = median of source[row][bin - WINDOW / 2 .. bin + WINDOW / 2][k]
 *
 * Beyond the detector's ends the bins are those before them, mirrored (the end bin twice). The
 * window is kept sorted: from one bin to the next a value leaves and another comes, each by one
 * pass without branches, in all lanes alike. So any window costs four operations a value.
 *
 * Index space: (runs of LANES ranks, segments of SEGMENT bins, rows). At least LANES ranks; the last
 * run begins early enough to be whole. WINDOW is odd.
 *
 * Buffers: source, out[along2, bins, ranks]. */

#include "include/portable.h"

#ifndef WINDOW
#define WINDOW 21
#endif
#ifndef SEGMENT
#define SEGMENT (LANES == 8 ? 256 : 64)
#endif
#define HALF (WINDOW / 2)

static int mirrored(int bin, int bins) {
  const int period = 2 * bins, place = ((bin % period) + period) % period;
  return place < bins ? place : period - 1 - place;
}

static lanes smaller(lanes a, lanes b) { return a < b ? a : b; }
static lanes larger(lanes a, lanes b) { return a < b ? b : a; }

KERNEL void column_median(
    __global const float *restrict source, __global float *restrict out, int bins, int ranks)
{
  const int begin = (int)get_global_id(0) * LANES;
  if (begin >= ranks) return;
  const int k = begin + LANES <= ranks ? begin : ranks - LANES;
  const int first = (int)get_global_id(1) * SEGMENT;
  const int end = first + SEGMENT < bins ? first + SEGMENT : bins;
  const long row = get_global_id(2) * (long)bins * ranks + k;
  lanes sorted[WINDOW];
  UNROLL for (int i = 0; i < WINDOW; i++) sorted[i] = INFINITY;
  for (int bin = first - HALF; bin <= first + HALF; bin++) {
    const lanes value = LOAD(source + row + (long)mirrored(bin, bins) * ranks);
    UNROLL for (int i = WINDOW - 1; i > 0; i--)
      sorted[i] = larger(sorted[i - 1], smaller(sorted[i], value));
    sorted[0] = smaller(sorted[0], value);
  }
  for (int bin = first; bin < end; bin++) {
    STORE(out + row + (long)bin * ranks, sorted[HALF]);
    const lanes old = LOAD(source + row + (long)mirrored(bin - HALF, bins) * ranks);
    const lanes value = LOAD(source + row + (long)mirrored(bin + HALF + 1, bins) * ranks);
    lanes before = -INFINITY;
    UNROLL for (int i = 0; i < WINDOW - 1; i++) {
      const lanes left = sorted[i] < old ? sorted[i] : sorted[i + 1];
      sorted[i] = larger(before, smaller(left, value));
      before = left;
    }
    sorted[WINDOW - 1] = larger(before, value);
  }
}
