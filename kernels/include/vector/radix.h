/* One digit of a radix sort: what counts the digits and what places the keys by them must agree on.
 *
 * A pass sorts by DIGIT_BITS bits of the key.
 *
 * In the first pass (FIRST 1) the list is all splats in index order, and those without a tile,
 * which are told by slots[i] == slots[i + 1], are left out. Later passes see `visible` elements. */

#ifndef DIGIT_BITS
#define DIGIT_BITS 8
#endif
#define DIGITS (1 << DIGIT_BITS)
#define DIGIT(key) (((key) >> shift) & (DIGITS - 1))

#ifndef FIRST
#define FIRST 0
#endif
#define ELEMENTS (FIRST ? splats : (int)visible[0])
#define LEFT_OUT(i) (FIRST && slots[i] == slots[(i) + 1])
