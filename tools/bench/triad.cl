/* The device's memory bandwidth: a = b + s * c (McCalpin's STREAM triad), twelve bytes a number.
 *
 * Each work-item takes RUN neighbouring `lanes`: many on a CPU, one on a GPU, where neighbouring
 * items read neighbouring numbers. */

#if LANES == 8
typedef float8 lanes;
#else
typedef float lanes;
#endif

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void triad(__global lanes *restrict a, __global const lanes *restrict b,
           __global const lanes *restrict c, float s)
{
  const size_t first = get_global_id(0) * RUN;
  for (size_t i = first; i < first + RUN; i++) a[i] = b[i] + s * c[i];
}
