/* Which items of a group hold the same key: what a stable counting sort by groups goes by.
 *
 * A group takes as many elements of its chunk at a time as it has items, in the order of the list. An
 * element's place is that of its key's first one among them and the number of equal keys before it;
 * the item that holds the first then moves the key's place on by all of them. So every place is
 * written by one item, and elements keep their order, without atomics.
 *
 * Everyone compares with everyone: GROUP / 4 reads of local memory, which all items make at one
 * address. That is less than log2(keys) passes of a sort for groups of a few hundred items. */

/* Keys of a group, four to a read. */
#define GROUP_KEYS ((GROUP + 3) / 4)
/* Of an item that has no element. */
#define NO_KEY (-1)

/* (equal keys of items before, equal keys of all items); the keys are in place, and stay until the
 * next barrier. */
static int2 equal_keys(__local const int4 *keys, int item, int key) {
  __local const int *each = (__local const int *)keys;
  int before = 0, after = 0, other = 0;
  for (; other + 4 <= item; other += 4) {
    const int4 same = keys[other / 4] == key;
    before -= same.x + same.y + same.z + same.w;
  }
  for (; other < item; other++) before += each[other] == key;
  for (; other < GROUP && other % 4 != 0; other++) after += each[other] == key;
  for (; other + 4 <= GROUP; other += 4) {
    const int4 same = keys[other / 4] == key;
    after -= same.x + same.y + same.z + same.w;
  }
  for (; other < GROUP; other++) after += each[other] == key;
  return (int2)(before, before + after);
}
