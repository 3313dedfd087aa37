/* Sort few keys by one work-item, in one launch in place of a dozen: all passes of the radix sort.
 *
 *     order[r] = splat of rank r,  by key, equal keys by index;  visible[0] = how many ranks there are
 *
 * The splats without a tile, slots[i] == slots[i + 1], are left out first. The digits of all passes
 * are counted on the way, as moving keys does not change how many have a digit. `keys` and
 * `other_order` are written over: every pass moves keys and order from one pair of arrays to the
 * other, and the last one, an even number of them, ends where the first began.
 *
 * Index space: one item.
 *
 * Buffers: keys, other_keys, order, other_order[splats], slots[splats + 1], visible[1]. */

#include "include/portable.h"

#define BITS 8
#define DIGITS (1 << BITS)
#define PASSES 4
#define DIGIT(key, pass) (((key) >> (BITS * (pass))) & (DIGITS - 1))

KERNEL void radix_sort_cpu(
    __global uint *keys, __global uint *other_keys, __global int *order, __global int *other_order,
    __global const int *restrict slots, __global long *restrict visible, int splats)
{
  if (get_global_id(0)) return;
  __local int places[PASSES * DIGITS];
  for (int k = 0; k < PASSES * DIGITS; k++) places[k] = 0;
  int filled = 0;
  for (int i = 0; i < splats; i++) {
    if (slots[i] == slots[i + 1]) continue;
    const uint key = keys[i];
    other_keys[filled] = key;
    order[filled++] = i;
    for (int pass = 0; pass < PASSES; pass++) places[pass * DIGITS + DIGIT(key, pass)]++;
  }
  visible[0] = filled;
  __global uint *keys_in = other_keys, *keys_out = keys;
  __global int *order_in = order, *order_out = other_order;
  for (int pass = 0; pass < PASSES; pass++) {
    __local int *own = places + pass * DIGITS;
    int before = 0;
    for (int digit = 0; digit < DIGITS; digit++) {
      const int count = own[digit];
      own[digit] = before;
      before += count;
    }
    for (int r = 0; r < filled; r++) {
      const uint key = keys_in[r];
      const int place = own[DIGIT(key, pass)]++;
      keys_out[place] = key;
      order_out[place] = order_in[r];
    }
    __global uint *const last_keys = keys_in;
    keys_in = keys_out;
    keys_out = last_keys;
    __global int *const last_order = order_in;
    order_in = order_out;
    order_out = last_order;
  }
}
