/* Phase tables to sinogram with the strip footprint: the transpose of radon_resample_edges.
 *
 *     y[view][slice][b] =
 *         scale * sum over k, r of (share(x_b) - share(x_{b+1})) table[slice][view][k][r],
 *     x_b = origin + step * (k + r / PHASES) - (b - 1/2).
 *
 * Entries follow each other up the detector, LANES at a time: the phases of a column lie together in
 * memory. Let B_b be the sum of the shares beyond edge b of the entries whose shadows it meets, and
 * W_b the sum of those that are wholly above edge b but not above edge b + 1; then
 *
 *     y[b] = scale * (B_b + M W_b - B_{b+1}),
 *
 * so that each edge's shares serve the bins on both of its sides. In a bin that no shadow touches
 * they cancel exactly.
 *
 * Index space: (runs of BINS bins, views of this run, slices). No two items write the same bin: no
 * atomics, and one order of summation, whatever BINS is.
 *
 * Buffers: sinogram[count, slices, bins], table[along2, count, PHASES, columns], geometry[first + count, 4],
 * footprints[first + count, 8], views[first + count, 2]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"
#include "include/tomo/shadow.h"
#include "include/transpose.h"

/* Bins that one item takes, one after the other. */
#ifndef BINS
#define BINS (LANES == 8 ? 64 : 1)
#endif
/* Runs of LANES entries in a column. */
#define GROUPS (PHASES / LANES)

KERNEL void radon_resample_edges_adjoint(
    __global real *restrict sinogram, __global const real *restrict table,
    __global const long4 *restrict geometry, __global const real *restrict footprints,
    __global const int2 *restrict views, int first, int count, int slice0, int slices,
    int bins, int columns)
{
  const int b0 = (int)get_global_id(0) * BINS;
  const int b1 = b0 + BINS < bins ? b0 + BINS : bins;
  const int number = (int)get_global_id(1), view = first + number;
  const int slice = (int)get_global_id(2), used = GROUPS * views[view].y;
  const long4 g = run_upwards(geometry[view], bins);
  const int mirrored = geometry[view].w < 0;
  const view_shape shadow = shape_of_view(footprints, view);
  const real per_bin = (real)GROUPS / FIXED_TO_REAL(g.w);
  const real reach = per_bin * shadow.HALF_WIDTH + GROUPS * (1e-3f + 1e-6f * columns);
  const real rest = FIXED_TO_REAL(g.z & 0xffffffffL) + 0.5f;
  __global const real *entries = table + ((long)slice * count + number) * PHASES * columns;
  __global real *y = sinogram + ((long)views[view].x * slices + slice0 + slice) * bins;
  lanes below = 0;
  int passed = 0;
  for (int b = b0; b <= b1; b++) {
    /* The groups that edge b meets, or one more to either side where rounding hides it. */
    const real edge = ((real)(b - WHOLE(g.z)) - rest) * per_bin;
    const real from = edge - reach - (1.0f - 1.0f / LANES), to = edge + reach;
    const int start = from < 0 ? 0 : from < used ? (int)from + 1 : used;
    const int end = to < 0 ? 0 : to < used ? (int)to + 1 : used;
    lanes beyond = 0;
    for (int m = start; m < end; m++)
      beyond = beyond + share(FROM_EDGE(g, m / GROUPS, m % GROUPS * LANES, b), shadow) *
                            LOAD(entries + m * LANES);
    if (b > b0) {
      lanes whole = 0;
      /* Wide bins hold thousands of entries: sums of sums round less than one long sum. */
      for (int m = passed; m < end;) {
        const int stop = m + PHASES < end ? m + PHASES : end;
        lanes part = 0;
        for (; m < stop; m++) part = part + LOAD(entries + m * LANES);
        whole = whole + part;
      }
      const lanes sum = below + shadow.WHOLE_SHARE * whole - beyond;
      y[PLACE(b - 1, mirrored, bins)] = shadow.SCALE * SUM_OF_LANES(sum);
    }
    below = beyond;
    passed = end;
  }
}
