/* One digit of a radix sort: what radix_count and radix_scatter must agree on.
 *
 * A pass sorts by DIGIT_BITS bits of the key. Each work-item has a counter for every digit in
 * local memory, in a column of its own (its neighbours' lie beside it, so that the banks of a GPU
 * are all used): DIGITS * GROUP numbers, at most 4 KiB with the defaults.
 *
 * In the first pass (FIRST 1) the list is all splats in index order, and those without a tile,
 * which are told by slots[i] == slots[i + 1], are left out. Later passes see `visible` elements. */

#ifndef DIGIT_BITS
#define DIGIT_BITS (LANES == 8 ? 8 : 4)
#endif
#define DIGITS (1 << DIGIT_BITS)
#define COUNTER(key) own[(((key) >> shift) & (DIGITS - 1)) * GROUP]

#ifndef FIRST
#define FIRST 0
#endif
#define ELEMENTS (FIRST ? splats : (int)visible[0])
#define LEFT_OUT(i) (FIRST && slots[i] == slots[(i) + 1])
