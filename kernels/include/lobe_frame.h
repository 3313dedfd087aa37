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

/* e^x, held to what a float32 holds: x = n ln 2 + r, |r| <= ln(2) / 2, and Cephes' polynomial of
 * degree 6 (Moshier 1989), to 2e-7. As in exponential.h, built-in ones are real calls on PoCL and
 * not the same bits everywhere. What is no number has e^-87. */
static lanes power_of_e(lanes x) {
  x = x > -87 ? x : -87;
  x = x < 88 ? x : 88;
  const lanes_int n = TO_INT(1.44269504f * x + (x < 0 ? (lanes)-0.5f : (lanes)0.5f));
  /* ln 2 in two parts, of which the first times n is exact. */
  const lanes whole = TO_FLOAT(n), r = x - whole * 0.693359375f + whole * 2.12194440e-4f;
  const lanes high = (1.9875691e-4f * r + 1.3981999e-3f) * r + 8.3334519e-3f;
  const lanes low = (high * r + 4.1665796e-2f) * r + 1.6666666e-1f;
  return ((low * r + 0.5f) * r * r + r + 1) * AS_LANES((n + 127) << 23);
}

/* A logarithm held between limits, and what is left of a slope by it. */
static lanes held(lanes x, float low, float high) {
  const lanes above = x > low ? x : low;
  return above < high ? above : high;
}

static lanes if_free(lanes x, float low, float high, lanes slope) { return (x > low) & (x < high) ? slope : 0; }
