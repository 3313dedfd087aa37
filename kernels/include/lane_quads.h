/* Four numbers that stand side by side, for each lane: read whole and exchanged in registers.
 *
 * Where each lane reads comes in an array of integers, since taking them out of a vector one by one
 * would cost as much again: a kernel finds the places of a run of rows first and reads afterwards. */

#if LANES == 8
typedef struct { real8 s0, s1, s2, s3; } lane_quad;
#if DOUBLE
typedef double4 real4_any;
#else
typedef float4 real4_any;
#endif
#if RIFT_POCL
typedef real4_any quad_at __attribute__((aligned(sizeof(real))));
#define QUAD(p) (*(const __global quad_at *)(p))
#else
#define QUAD(p) vload4(0, p)
#endif
/* The zero, which a compiler may not leave out, keeps it from taking the two apart again. */
#define QUAD_PAIR(p, i, j) ((real8)(QUAD(p + (i)), QUAD(p + (j))) + (real)0)

/* Lane n has p[at[n]] and the three numbers behind it. */
static lane_quad quads_at(__global const real *p, const int *at) {
  const real8 a = QUAD_PAIR(p, at[0], at[4]), b = QUAD_PAIR(p, at[1], at[5]);
  const real8 c = QUAD_PAIR(p, at[2], at[6]), d = QUAD_PAIR(p, at[3], at[7]);
  const real8 e = (real8)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5);
  const real8 f = (real8)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7);
  const real8 g = (real8)(c.s0, d.s0, c.s1, d.s1, c.s4, d.s4, c.s5, d.s5);
  const real8 h = (real8)(c.s2, d.s2, c.s3, d.s3, c.s6, d.s6, c.s7, d.s7);
  lane_quad found;
  found.s0 = (real8)(e.s01, g.s01, e.s45, g.s45);
  found.s1 = (real8)(e.s23, g.s23, e.s67, g.s67);
  found.s2 = (real8)(f.s01, h.s01, f.s45, h.s45);
  found.s3 = (real8)(f.s23, h.s23, f.s67, h.s67);
  return found;
}
#else
typedef struct { real s0, s1, s2, s3; } lane_quad;
static lane_quad quads_at(__global const real *p, const int *at) {
  __global const real *from = p + at[0];
  lane_quad found;
  found.s0 = from[0];
  found.s1 = from[1];
  found.s2 = from[2];
  found.s3 = from[3];
  return found;
}
#endif

/* Writes a whole number for each lane, as quads_at reads them, and reads them all again; NEXT_INTS
 * reads those of the lanes after them. */
#if LANES == 8 && RIFT_POCL
typedef int8 ints_at __attribute__((aligned(sizeof(int))));
#define INTS_AT(at) (*(const ints_at *)(at))
#elif LANES == 8
#define INTS_AT(at) vload8(0, at)
#endif
#if LANES == 8 && DOUBLE && RIFT_POCL
#define KEEP_INTS(at, v) (*(int8 *)(at) = __builtin_convertvector(v, int8))
#define KEPT_INTS(at) __builtin_convertvector(*(const int8 *)(at), long8)
#define NEXT_INTS(at) __builtin_convertvector(INTS_AT((at) + 1), long8)
#elif LANES == 8 && DOUBLE
#define KEEP_INTS(at, v) (*(int8 *)(at) = convert_int8(v))
#define KEPT_INTS(at) convert_long8(*(const int8 *)(at))
#define NEXT_INTS(at) convert_long8(INTS_AT((at) + 1))
#elif LANES == 8
#define KEEP_INTS(at, v) (*(int8 *)(at) = (v))
#define KEPT_INTS(at) (*(const int8 *)(at))
#define NEXT_INTS(at) INTS_AT((at) + 1)
#else
#define KEEP_INTS(at, v) (*(at) = (int)(v))
#define KEPT_INTS(at) (*(at))
#define NEXT_INTS(at) ((at)[1])
#endif

#if LANES == 8
#if DOUBLE
typedef double2 real2_any;
#else
typedef float2 real2_any;
#endif
static real largest_lane(real8 v) {
  const real4_any four = v.lo > v.hi ? v.lo : v.hi;
  const real2_any two = four.lo > four.hi ? four.lo : four.hi;
  return two.s0 > two.s1 ? two.s0 : two.s1;
}
#else
static real largest_lane(real v) { return v; }
#endif
