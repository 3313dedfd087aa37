/* Vectors and matrices of three, and the test for numbers that are none.
 *
 * OpenCL's dot, cross and length are real calls on some drivers; these are plain arithmetic.
 * NaN and infinity are found by their bits, since a compiler may take v != v for false. */

typedef struct {
  float3 x, y, z;
} rows3;

static float dot3(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static float3 cross3(float3 a, float3 b) {
  return (float3)(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* matrix * v */
static float3 apply3(rows3 matrix, float3 v) {
  return (float3)(dot3(matrix.x, v), dot3(matrix.y, v), dot3(matrix.z, v));
}

/* transposed matrix * v */
static float3 apply_transposed3(rows3 matrix, float3 v) {
  return v.x * matrix.x + v.y * matrix.y + v.z * matrix.z;
}

static float3 load3(__global const float *p, long i) {
  return (float3)(p[3 * i], p[3 * i + 1], p[3 * i + 2]);
}

static void store3(__global float *p, long i, float3 v) {
  p[3 * i] = v.x;
  p[3 * i + 1] = v.y;
  p[3 * i + 2] = v.z;
}

static float absolute1(float v) { return v < 0 ? -v : v; }

static int not_finite(float v) { return (as_uint(v) & 0x7f800000u) == 0x7f800000u; }

static int not_finite3(float3 v) { return not_finite(v.x) | not_finite(v.y) | not_finite(v.z); }
