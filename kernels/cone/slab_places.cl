/* Where the samples of every slab are seen in a view's table: along its columns, or along its rows.
 *
 *     place(a) = origin + (n0 + n1 a + n2 b) / (d0 + d1 a + d2 b),
 *
 * with ARC 1 origin + radius * atan of the fraction; a = a0 + da (sample0 + i) is the coordinate of
 * sample i, b that of its slab. The edges of the sample, a -+ da/2, end its shadow. STRIP 1 shares
 * it among the entries that the shadow overlaps; otherwise a hat as wide as the shadow, or two
 * entries at least, is shared in proportion to its heights; with POINT 1 it is two entries wide in
 * any case. `places` is the first entry of TAPS, `shares` what the others receive of 1 (see
 * include/cone/slab_table.h): those of a slab's samples in their second entries, then in their
 * third ones, and so on. A sample that is seen off the table is put on its edge, where entries are
 * zero.
 *
 * forms[view] = n0 n1 n2 d0 d1 d2 origin radius.
 *
 * Index space: (runs of RUN samples, slabs, views of this run). Samples are padded to whole lanes.
 *
 * Buffers: places[along2, slabs, samples], shares[along2, slabs, TAPS - 1, samples],
 * forms[first + along2, 8]. */

#include "include/portable.h"
#include "include/cone/slab_table.h"

#ifndef STRIP
#define STRIP 1
#endif
#ifndef POINT
#define POINT 0
#endif
#ifndef ARC
#define ARC 0
#endif
#ifndef RUN
#define RUN LANES
#endif

/* Halves of doubles: PoCL's compiler dies ("Cannot emit physreg copy instruction") of eight at once. */
#if DOUBLE && LANES == 8
#define ARC_TANGENT(v) ((lanes)(atan((v).lo), atan((v).hi)))
#else
#define ARC_TANGENT(v) atan(v)
#endif

static lanes seen(__global const real *f, lanes a, real b) {
  const lanes fraction = ((f[0] + f[2] * b) + f[1] * a) / ((f[3] + f[5] * b) + f[4] * a);
  return ARC ? f[7] * ARC_TANGENT(fraction) : fraction;
}

/* Height of a footprint in the entry that stands `ahead` of where it begins. */
#if STRIP
#define HALF_WIDTH(width) (0.5f * (width))
#define FIRST 0.5f
static lanes height(lanes ahead, lanes half_width) {
  const lanes end = 2.0f * half_width - ahead, begin = -ahead;
  const lanes above = end < 1.0f ? end : (lanes)1.0f, below = begin > 0.0f ? begin : (lanes)0;
  return above > below ? above - below : (lanes)0;
}
#else
#define HALF_WIDTH(width) (POINT ? (lanes)1.0f : ((width) > 1.0f ? (width) : (lanes)1.0f))
#define FIRST 1.0f
static lanes height(lanes ahead, lanes half_width) {
  const lanes left = half_width - absolute(ahead + 1.0f - half_width);
  return left > 0.0f ? left : (lanes)0;
}
#endif

KERNEL void slab_places(
    __global int *restrict places, __global real *restrict shares,
    __global const real *restrict forms, int first, int samples, int slabs, int entries,
    int sample0, real a0, real da, real b0, real db)
{
  const int i0 = (int)get_global_id(0) * RUN, slab = (int)get_global_id(1);
  const int view = (int)get_global_id(2);
  const int i1 = i0 + RUN < samples ? i0 + RUN : samples;
  __global const real *f = forms + 8L * (first + view);
  const long at = ((long)view * slabs + slab) * samples;
  const real b = b0 + db * slab, origin = f[6];
  for (int i = i0; i < i1; i += LANES) {
    const lanes a = a0 + da * ((real)(sample0 + i) + LANE_NUMBERS);
    const lanes one = seen(f, a - 0.5f * da, b), other = seen(f, a + 0.5f * da, b);
    const lanes low = one < other ? one : other, high = one < other ? other : one;
    const lanes half_width = HALF_WIDTH(high - low);
    lanes begin = origin + 0.5f * (low + high) - half_width + FIRST;
    begin = begin > -1.0f ? begin : (lanes)-1.0f;
    begin = begin < (real)entries ? begin : (lanes)(real)entries;
    lanes_int place = floor_int(begin);
    const lanes rest = begin - TO_FLOAT(place);
    const lanes_int seen_here = place >= 0 && place <= entries - TAPS;
    place = place < 0 ? (lanes_int)0 : place;
    place = place > entries - TAPS ? (lanes_int)(entries - TAPS) : place;
    lanes heights[TAPS], sum = 0;
    UNROLL for (int t = 0; t < TAPS; t++) {
      heights[t] = height((real)t - rest, half_width);
      sum = sum + heights[t];
    }
    for (int n = 0; n < LANES; n++) places[at + i + n] = (int)((integer *)&place)[n];
    UNROLL for (int t = 1; t < TAPS; t++)
      STORE(shares + at * (TAPS - 1) + (t - 1) * samples + i,
            seen_here ? heights[t] / sum : (lanes)0);
  }
}
