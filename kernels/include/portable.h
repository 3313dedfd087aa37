/* One source for every device.
 *
 * A CPU wants one work-item per run of samples, with explicit vectors of eight; a GPU wants a
 * work-item per sample, many to a group. A kernel is therefore written in `lanes`, which are
 * eight floats on a CPU (LANES 8, GROUP 1) and one float on a GPU (LANES 1, GROUP 64): its
 * arithmetic reads the same for both, since OpenCL's operators and ?: work on either. Vectors of
 * eight occur where LANES is 8 alone: some compilers for GPUs know none of more than four.
 *
 * With DOUBLE 1 the same source computes in double precision: `real` is what one lane holds, and
 * `lanes_int` are whole numbers as wide, which ?: on lanes asks for. Scalars of such a kernel are
 * `real` too (a vector of doubles takes a float on its side, a vector of floats takes no double).
 *
 * Built-in functions: on PoCL 3.0 vload8, convert_int8, floor, mad, clamp are real calls round
 * which every live vector register is spilled, 2.5 to 60 times slower in an inner loop. Kernels
 * use the macros below, which avoid them there and are the built-ins elsewhere. */

#ifndef LANES
#define LANES 8
#endif
#ifndef GROUP
#define GROUP 1
#endif
#ifndef RIFT_POCL
#define RIFT_POCL 0
#endif

#ifndef DOUBLE
#define DOUBLE 0
#endif

#if DOUBLE
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double real;
typedef long integer;
#if LANES == 8
typedef double8 real8;
typedef double4 real4;
typedef long8 integer8;
#endif
#define TO_INTEGER8(v) convert_long8(v)
#define TO_REAL8(v) convert_double8(v)
#else
typedef float real;
typedef int integer;
#if LANES == 8
typedef float8 real8;
typedef float4 real4;
typedef int8 integer8;
#endif
#define TO_INTEGER8(v) convert_int8(v)
#define TO_REAL8(v) convert_float8(v)
#endif

#define KERNEL __kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
#define UNROLL _Pragma("unroll")
/* A group's number in the grid that was asked for. A grid beyond what a device takes is launched in
 * parts, each with an offset: get_global_id counts on from it, but get_group_id, get_num_groups and
 * get_global_size know of their part alone, so that no kernel uses these for anything else. */
#define GROUP_NUMBER(axis) \
  ((int)(get_group_id(axis) + get_global_offset(axis) / get_local_size(axis)))

#if LANES == 8
typedef real8 lanes;
typedef integer8 lanes_int;
#define LANE_NUMBERS ((real8)(0, 1, 2, 3, 4, 5, 6, 7))
#define GATHER(p, i) \
  ((real8)((p)[(i).s0], (p)[(i).s1], (p)[(i).s2], (p)[(i).s3], \
           (p)[(i).s4], (p)[(i).s5], (p)[(i).s6], (p)[(i).s7]))
#else
typedef real lanes;
typedef integer lanes_int;
#define LANE_NUMBERS ((real)0)
#define GATHER(p, i) ((p)[i])
#endif

/* The number of the lowest bit of a ulong that is set. */
#if RIFT_POCL
#define LOWEST_BIT(bits) __builtin_ctzl(bits)
#else
#define LOWEST_BIT(bits) (63 - (int)clz((bits) & -(bits)))
#endif

/* Asks for memory that will be read a little later; a hint alone. */
#if LANES == 8 && RIFT_POCL
#define PREFETCH(p) __builtin_prefetch(p)
#else
#define PREFETCH(p)
#endif

#if LANES == 8 && RIFT_POCL
typedef real8 lanes_at __attribute__((aligned(sizeof(real))));
typedef real4 half_at __attribute__((aligned(sizeof(real))));
#define LOAD(p) (*(const __global lanes_at *)(p))
#define LOAD_HALF(p) (*(const __global half_at *)(p))
#define STORE(p, v) (*(__global lanes_at *)(p) = (v))
#define TO_INT(v) __builtin_convertvector(v, integer8)
#define TO_FLOAT(v) __builtin_convertvector(v, real8)
#elif LANES == 8
#define LOAD(p) vload8(0, p)
#define LOAD_HALF(p) vload4(0, p)
#define STORE(p, v) vstore8(v, 0, p)
#define TO_INT(v) TO_INTEGER8(v)
#define TO_FLOAT(v) TO_REAL8(v)
#else
#define LOAD(p) (*(p))
#define STORE(p, v) (*(p) = (v))
#define TO_INT(v) ((integer)(v))
#define TO_FLOAT(v) ((real)(v))
#endif

/* a b + c in one way wherever it stands. What `c + a * b` is, a compiler may choose, and Intel's chooses
 * otherwise in a loop than in the rest of its turns: sums that are cut into parts would have other bits. */
#if RIFT_POCL
#define MULTIPLY_ADD(a, b, c) ((c) + (a) * (b))
#else
#define MULTIPLY_ADD(a, b, c) mad((lanes)(a), b, c)
#endif

/* Largest whole number not above v, for |v| < 2^31. */
static lanes_int floor_int(lanes v) {
  lanes_int i = TO_INT(v);
  return TO_FLOAT(i) > v ? i - 1 : i;
}

static lanes absolute(lanes v) { return v < 0 ? -v : v; }
