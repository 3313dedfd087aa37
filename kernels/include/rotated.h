/* Vectors turned by quaternions of length one, LANES of each at a time: by a splat's own, or back by
 * that with its vector part negated. */

#include "include/lane_vectors.h"

/* Turned by the unit quaternion (w, v): x + 2 (w v x x + v x (v x x)). */
static lanes3 rotated(lanes3 x, lanes w, lanes3 v) {
  const lanes3 once = cross_of(v, x), more = plus(times(w, once), cross_of(v, once));
  return plus(x, plus(more, more));
}
