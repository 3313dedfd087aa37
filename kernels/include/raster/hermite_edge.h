/* Where line integrals through splats with modes end, in standard deviations, by order.
 *
 * A Gaussian ends at 4, with exp(-8) = 3.4e-4 of its peak. A splat of order n ends where
 * |He~_n(x)| exp(-x^2 / 2) falls under the same number for the last time; of all modes of an order
 * the one along a single axis reaches farthest. */

#define HERMITE_EDGE(n) \
  ((n) == 0 ? 4.0f : (n) == 1 ? 4.353f : (n) == 2 ? 4.619f : (n) == 3 ? 4.837f : \
   (n) == 4 ? 5.020f : (n) == 5 ? 5.176f : (n) == 6 ? 5.306f : (n) == 7 ? 5.412f : 5.491f)
