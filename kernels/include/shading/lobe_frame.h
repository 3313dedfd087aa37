/* A lobe's frame: the columns t, b, a of a quaternion's rotation, and the way back to it.
 *
 * A function of d in this frame does not change when frame and direction turn together. Turning
 * the frame by a small w is thus turning d by -w, so that with g = dL/dd
 *
 *     dL = w . (g x d),        and with the quaternion (s, v) of unit length, w = 2 vec(dq q*),
 *     dL/ds = -2 (g x d) . v,  dL/dv = 2 (s (g x d) - v x (g x d)).
 *
 * This has no part along q, so the quaternion's length only divides it. */

#include "include/lane_vectors.h"

/* Quaternions and axes with no component above this have no direction. */
#define LEAST_LENGTH 1e-30f

typedef struct {
  lanes3 t, b, a;
  lanes s;
  lanes3 v;
  lanes inverse; /* of the quaternion's length */
} Frame;

static lanes largest_of(lanes3 v) { return larger(larger(absolute(v.x), absolute(v.y)), absolute(v.z)); }

/* Whether all numbers of a geometry are finite. */
static lanes_int all_finite(const lanes *numbers, int count) {
  lanes_int bad = no_number(numbers[0]);
  for (int k = 1; k < count; k++) bad |= no_number(numbers[k]);
  return !bad;
}

/* The frame of a quaternion (s, v) of any length but none. */
static lanes_int read_frame(Frame *f, const lanes *quat) {
  const lanes3 v = lanes3_of(quat[1], quat[2], quat[3]);
  const lanes largest = larger(absolute(quat[0]), largest_of(v));
  const lanes even = 1 / largest, s = quat[0] * even;
  const lanes3 u = times(even, v);
  const lanes inverse = inverse_root(s * s + dot_of(u, u));
  f->inverse = inverse * even;
  f->s = s * inverse;
  f->v = times(inverse, u);
  const lanes3 q = f->v, twice = plus(q, q), turn = times(f->s, twice);
  const lanes xx = twice.x * q.x, yy = twice.y * q.y, zz = twice.z * q.z;
  const lanes xy = twice.x * q.y, xz = twice.x * q.z, yz = twice.y * q.z;
  f->t = lanes3_of(1 - (yy + zz), xy + turn.z, xz - turn.y);
  f->b = lanes3_of(xy - turn.z, 1 - (xx + zz), yz + turn.x);
  f->a = lanes3_of(xz + turn.y, yz - turn.x, 1 - (xx + yy));
  return largest > LEAST_LENGTH;
}

/* dL/dquaternion from g = dL/dd. */
static void frame_grad(const Frame *f, lanes3 g, lanes3 d, lanes *grad) {
  const lanes3 turn = times(2 * f->inverse, cross_of(g, d));
  const lanes3 by = minus(times(f->s, turn), cross_of(f->v, turn));
  grad[0] = -dot_of(turn, f->v);
  grad[1] = by.x;
  grad[2] = by.y;
  grad[3] = by.z;
}

/* A logarithm held between limits, and what is left of a slope by it. */
static lanes held(lanes x, float low, float high) {
  const lanes above = x > low ? x : low;
  return above < high ? above : high;
}

static lanes if_free(lanes x, float low, float high, lanes slope) { return ((x > low) & (x < high)) ? slope : 0; }
