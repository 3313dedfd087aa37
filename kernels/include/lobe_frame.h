/* A lobe's frame: the columns t, b, a of a quaternion's rotation, and the way back to it.
 *
 * A function of d in this frame does not change when frame and direction turn together. Turning
 * the frame by a small w is thus turning d by -w, so that with g = dL/dd
 *
 *     dL = w . (g x d),        and with the quaternion (s, v) of unit length, w = 2 vec(dq q*),
 *     dL/ds = -2 (g x d) . v,  dL/dv = 2 (s (g x d) - v x (g x d)).
 *
 * This has no part along q, so the quaternion's length only divides it. Needs small_matrix.h. */

/* Quaternions and axes with no component above this have no direction. */
#define LEAST_LENGTH 1e-30f

typedef struct {
  float3 t, b, a;
  float s;
  float3 v;
  float inverse; /* of the quaternion's length */
} Frame;

static float larger1(float a, float b) { return a > b ? a : b; }

static float largest3(float3 v) { return larger1(larger1(absolute1(v.x), absolute1(v.y)), absolute1(v.z)); }

/* Whether all numbers of a geometry are finite. */
static int all_finite(__global const float *numbers, int count) {
  int bad = 0;
  for (int k = 0; k < count; k++) bad |= not_finite(numbers[k]);
  return !bad;
}

/* The frame of a quaternion (s, v) of any length but none. */
static int read_frame(Frame *f, __global const float *quat) {
  const float3 v = (float3)(quat[1], quat[2], quat[3]);
  const float largest = larger1(absolute1(quat[0]), largest3(v));
  if (!(largest > LEAST_LENGTH)) return 0;
  const float even = 1 / largest, s = quat[0] * even;
  const float3 u = v * even;
  const float inverse = 1 / sqrt(s * s + dot3(u, u));
  f->inverse = inverse * even;
  f->s = s * inverse;
  f->v = u * inverse;
  const float3 q = f->v, twice = 2 * q, square = twice * q, turn = f->s * twice;
  const float xy = twice.x * q.y, xz = twice.x * q.z, yz = twice.y * q.z;
  f->t = (float3)(1 - (square.y + square.z), xy + turn.z, xz - turn.y);
  f->b = (float3)(xy - turn.z, 1 - (square.x + square.z), yz + turn.x);
  f->a = (float3)(xz + turn.y, yz - turn.x, 1 - (square.x + square.y));
  return 1;
}

/* dL/dquaternion from g = dL/dd. */
static void store_frame_grad(const Frame *f, float3 g, float3 d, __global float *grad) {
  const float3 turn = 2 * f->inverse * cross3(g, d);
  grad[0] = -dot3(turn, f->v);
  store3(grad + 1, 0, f->s * turn - cross3(f->v, turn));
}

/* e^x, held to what a float32 holds: x = n ln 2 + r, |r| <= ln(2) / 2, and Cephes' polynomial of
 * degree 6 (Moshier 1989), to 2e-7. As in exponential.h, built-in ones are real calls on PoCL and
 * not the same bits everywhere. */
static float power_of_e(float x) {
  x = x < -87 ? -87 : x > 88 ? 88 : x;
  const int n = (int)(1.44269504f * x + (x < 0 ? -0.5f : 0.5f));
  /* ln 2 in two parts, of which the first times n is exact. */
  const float r = x - n * 0.693359375f + n * 2.12194440e-4f;
  const float high = (1.9875691e-4f * r + 1.3981999e-3f) * r + 8.3334519e-3f;
  const float low = (high * r + 4.1665796e-2f) * r + 1.6666666e-1f;
  return ((low * r + 0.5f) * r * r + r + 1) * as_float((n + 127) << 23);
}

/* A logarithm held between limits, and whether it is free to move. */
static float held(float x, float low, float high) { return x < low ? low : x > high ? high : x; }

static int is_free(float x, float low, float high) { return x > low && x < high; }
