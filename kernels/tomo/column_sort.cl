/* Sort every detector column along the views, and tell where each value came from.
 *
 *     ranked[c][k] = values[c][order[c][k]],  ascending in k; equal values keep the views' order.
 *
 * A stable radix sort, from the least digit of the key to the greatest, in PASSES of at most
 * DIGIT_BITS bits: keys are counted from the least of their column, and digits are as short as
 * their range allows. One work-item sorts RUN columns, one after the other, in two lists of its own
 * (`spare`, two times `views` pairs of key and view); a column of some thousand views stays in a
 * CPU's first cache meanwhile. `ranked` may be `values` itself.
 *
 * Index space: runs of columns.
 *
 * Buffers: values, ranked, order[columns, views], spare[(columns + RUN - 1) / RUN, 2, views, 2]. */

#include "include/portable.h"
#include "include/tomo/sort_key.h"

#ifndef DIGIT_BITS
#define DIGIT_BITS (LANES == 8 ? 11 : 4)
#endif
#ifndef RUN
#define RUN (LANES == 8 ? 16 : 1)
#endif
#define DIGITS (1 << DIGIT_BITS)
#define PASSES ((31 + DIGIT_BITS) / DIGIT_BITS)
#define DIGIT(key, shift) ((((key) >> (shift)) & mask) * GROUP)

static void clear(__local int *own, int digits) {
  for (int digit = 0; digit < digits; digit++) own[digit * GROUP] = 0;
}

/* Counts become the places at which the values of each digit begin. */
static void accumulate(__local int *own, int digits) {
  int place = 0;
  for (int digit = 0; digit < digits; digit++) {
    const int count = own[digit * GROUP];
    own[digit * GROUP] = place;
    place += count;
  }
}

KERNEL void column_sort(
    __global const float *values, __global float *ranked, __global int *restrict order,
    __global uint2 *restrict spare, int columns, int views)
{
  __local int counters[2 * DIGITS * GROUP];
  const int item = (int)get_global_id(0);
  __global uint2 *first = spare + (long)item * 2 * views, *second = first + views;
  for (int c = item * RUN; c < columns && c < item * RUN + RUN; c++) {
    const long at = (long)c * views;
    uint least = 0xffffffffu, most = 0;
    for (int v = 0; v < views; v++) {
      const uint key = key_of(values[at + v]);
      least = key < least ? key : least;
      most = key > most ? key : most;
    }
    const int width = ((most > least ? 32 - (int)clz(most - least) : 1) + PASSES - 1) / PASSES;
    const uint mask = (1u << width) - 1;
    __local int *now = counters + get_local_id(0), *next = now + DIGITS * GROUP;
    clear(now, mask + 1);
    for (int v = 0; v < views; v++) {
      const uint key = key_of(values[at + v]) - least;
      first[v] = (uint2)(key, v);
      now[DIGIT(key, 0)]++;
    }
    accumulate(now, mask + 1);
    /* While values move by one digit, the next one is counted. */
    for (int shift = width; shift < PASSES * width; shift += width) {
      clear(next, mask + 1);
      for (int v = 0; v < views; v++) {
        const uint2 pair = first[v];
        second[now[DIGIT(pair.x, shift - width)]++] = pair;
        next[DIGIT(pair.x, shift)]++;
      }
      accumulate(next, mask + 1);
      __global uint2 *list = first;
      first = second;
      second = list;
      __local int *own = now;
      now = next;
      next = own;
    }
    for (int v = 0; v < views; v++) {
      const uint2 pair = first[v];
      const int place = now[DIGIT(pair.x, (PASSES - 1) * width)]++;
      ranked[at + place] = value_of(pair.x + least);
      order[at + place] = (int)pair.y;
    }
  }
}
