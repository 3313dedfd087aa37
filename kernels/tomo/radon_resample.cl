/* Sinogram to phase tables (see include/tomo/phase_table.h).
 *
 *     table[slice][view][r][k] = scale * sum over bins b of footprint(tau - b) y[view][slice][b],
 *     tau = origin + step * (k + r / PHASES).
 *
 * Index space: (runs of LANES columns, views of this run, slices). The PHASES entries of a column
 * lie within one step of each other, so they share their bins: a CPU takes phases as lanes, a
 * column at a time, a broadcast load for each bin, and transposes at the end; a GPU takes its one
 * column phase by phase. Columns reach one bin more or less; as long as that is cheaper than a
 * branch that a CPU guesses wrongly, they take the `usual` number, of which the footprints of those
 * out of reach are zero. Bins outside the detector count as zero. `views` holds, for each view of
 * the table, which view of the scan it is and how many columns it needs; the sinogram has `slices`
 * slices, of which the table takes those from slice0.
 *
 * Buffers: sinogram[count, slices, bins], table[along2, count, PHASES, columns], geometry[first + count, 4],
 * footprints[first + count, 8], views[first + count, 2]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"
#include "include/tomo/footprint.h"
#include "include/transpose.h"

KERNEL void radon_resample(
    __global const real *restrict sinogram, __global real *restrict table,
    __global const long4 *restrict geometry, __global const real *restrict footprints,
    __global const int2 *restrict views, int first, int count, int slice0, int slices,
    int bins, int columns)
{
  const int k0 = (int)get_global_id(0) * LANES;
  const int number = (int)get_global_id(1), view = first + number;
  const int slice = (int)get_global_id(2);
  if (k0 >= views[view].y) return;
  const long4 g = geometry[view];
  const view_shape shape = shape_of_view(footprints, view);
  const long support = (long)(4294967296.0f * shape.SUPPORT);
  const long spread = g.w - (g.w >> LOG2_PHASES);
  const long lower = (spread < 0 ? spread : 0) - support, upper = (spread > 0 ? spread : 0) + support;
  const int usual = WHOLE(upper - lower + (3L << 30));
  __global const real *y = sinogram + ((long)views[view].x * slices + slice0 + slice) * bins;
  lanes entries[PHASES];
  UNROLL for (int n = 0; n < PHASES; n++) {
    const int k = LANES == 1 ? k0 : k0 + n, phase = LANES == 1 ? n : 0;
    const long tau = g.z + k * g.w;
    const int near = WHOLE(tau + lower) + 1, last = WHOLE(tau + upper) + 1;
    const int far = near + usual > last ? near + usual : last;
    lanes sum = 0;
    for (int b = near > 0 ? near : 0; b < (far < bins ? far : bins); b++)
      sum = sum + y[b] * footprint(DISTANCES(g, k, phase, b), shape);
    entries[n] = shape.SCALE * sum;
  }
  TRANSPOSE(entries)
  __global real *out = table + ((long)slice * count + number) * PHASES * columns + k0;
  UNROLL for (int r = 0; r < PHASES; r++) STORE(out + (long)r * columns, entries[r]);
}
