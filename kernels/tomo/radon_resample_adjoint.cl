/* Phase tables to sinogram: the transpose of radon_resample.
 *
 *     y[view][slice][b] = scale * sum over k, r of footprint(tau - b) table[slice][view][k][r],
 *     tau = origin + step * (k + r / PHASES).
 *
 * Index space: (bins, views of this run, slices). Each item gathers, for its bins, the
 * columns whose footprints can touch them; the phases of a column lie together in memory and are
 * taken LANES at a time. No two items write the same bin: no atomics, and one order of summation.
 *
 * Buffers: sinogram[count, slices, bins], table[along2, count, PHASES, columns], geometry[first + count, 4],
 * footprints[first + count, 8], views[first + count, 2]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"
#include "include/tomo/footprint.h"
#include "include/transpose.h"

/* Bins that one item takes, one after the other. */
#ifndef BINS
#define BINS (LANES == 8 ? 64 : 1)
#endif

KERNEL void radon_resample_adjoint(
    __global real *restrict sinogram, __global const real *restrict table,
    __global const long4 *restrict geometry, __global const real *restrict footprints,
    __global const int2 *restrict views, int first, int count, int slice0, int slices,
    int bins, int columns)
{
  const int b0 = (int)get_global_id(0) * BINS;
  const int b1 = b0 + BINS < bins ? b0 + BINS : bins;
  const int number = (int)get_global_id(1), view = first + number;
  const int slice = (int)get_global_id(2), used = views[view].y;
  /* One by one: of a whole long4 clspv makes a vector of eight, which Vulkan has none of. */
  __global const long *line = (__global const long *)(geometry + view);
  const long4 g = (long4)(line[0], line[1], line[2], line[3]);
  const view_shape shape = shape_of_view(footprints, view);
  const real per_bin = 1.0f / FIXED_TO_REAL(g.w);
  const real reach = (per_bin < 0 ? -per_bin : per_bin) * shape.SUPPORT + 1e-3f + 1e-6f * columns;
  __global const real *entries = table + ((long)slice * count + number) * PHASES * columns;
  __global real *y = sinogram + ((long)views[view].x * slices + slice0 + slice) * bins;
  for (int b = b0; b < b1; b++) {
    /* The columns with a phase in reach, or one more where rounding hides it. */
    const real center = ((real)(b - WHOLE(g.z)) - FIXED_TO_REAL(g.z & 0xffffffffL)) * per_bin;
    const real from = center - reach - (1.0f - 1.0f / PHASES), to = center + reach;
    const int start = from < 0 ? 0 : from < used ? (int)from + 1 : used;
    const int end = to < 0 ? 0 : to < used ? (int)to + 1 : used;
    lanes sum = 0;
    for (int k = start; k < end; k++)
      UNROLL for (int r = 0; r < PHASES; r += LANES)
        sum = sum + footprint(DISTANCES(g, k, r, b), shape) * LOAD(entries + k * PHASES + r);
    y[b] = shape.SCALE * SUM_OF_LANES(sum);
  }
}
