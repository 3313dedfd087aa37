/* Sums of products of two arrays, one for each of a fixed number of work-items.
 *
 *     sums[item] + sums[count + item] = sum over the item's samples of (scale x[i]) (scale y[i])
 *
 * or of scale x[i] alone unless PRODUCT. The scale is a power of two, which changes no digit: 1, but
 * where products would leave the range of the type.
 *
 * On a CPU an item's samples are a run of LENGTH of them, on a GPU every COUNT-th, so that neighbours
 * read neighbours. Additions are compensated (Neumaier 1974): what rounding loses of each one is
 * summed apart, so that a sum of millions is as good as its products. Which sample goes to which
 * item and lane depends on the size and the device alone, and with it every bit of the result.
 *
 * Index space: (items).
 *
 * Buffers: x[size], y[PRODUCT ? size : 0], sums[2, count]. */

#include "include/portable.h"

#ifndef PRODUCT
#define PRODUCT 1
#endif
#define CONTIGUOUS (LANES == 8)
#define AT(load, p, q) (PRODUCT ? (scale * load(p)) * (scale * load(q)) : scale * load(p))
#define ONE(p) (*(p))

/* Where the larger operand is exact, the difference is what the addition lost. */
#define ADD(sum, rest, value) \
  { \
    const lanes term = (value), next = sum + term; \
    rest = rest + (absolute(sum) >= absolute(term) ? (sum - next) + term : (term - next) + sum); \
    sum = next; \
  }

static real over_lanes(lanes v) {
  const real *parts = (const real *)&v;
  real sum = 0;
  UNROLL for (int k = 0; k < LANES; k++) sum += parts[k];
  return sum;
}

KERNEL void dot_product(
    __global const real *x, __global const real *y, __global real *sums,
    ulong size, ulong length, ulong count, real scale)
{
  const ulong item = get_global_id(0);
  if (item >= count) return;
  const ulong begin = CONTIGUOUS ? item * length : item;
  const ulong end = CONTIGUOUS && begin + length < size ? begin + length : size;
  const ulong stride = CONTIGUOUS ? LANES : count;
  lanes sum = 0, rest = 0;
  ulong i = begin;
  for (; i + LANES <= end; i += stride) ADD(sum, rest, AT(LOAD, x + i, y + i));
  real tail = 0;
  if (LANES > 1)
    for (; i < end; i++) tail += AT(ONE, x + i, y + i);
  sums[item] = over_lanes(sum) + tail;
  sums[count + item] = over_lanes(rest);
}
