/* Sinogram to phase tables with the strip footprint (see include/tomo/phase_table.h,
 * include/tomo/shadow.h).
 *
 * A view is a staircase whose steps are the edges between bins, zero outside the detector. A pixel
 * reads its mean over the pixel's shadow: the bin below the shadow, and of each step that the
 * shadow meets the share that lies beyond it,
 *
 *     table[slice][view][r][k] = scale * (M y[b0-1] + sum over b of (y[b] - y[b-1]) share(x_b)),
 *     x_b = origin + step * (k + r / PHASES) - (b - 1/2),
 *
 * b0 being the first edge in reach of the column. A shadow meets one edge fewer than bins, and a
 * share is half of the arithmetic of a bin's area, so this costs hardly more than interpolation.
 *
 * Index space and layout are those of radon_resample: (runs of LANES columns, views of this run,
 * slices); a CPU takes the phases of a column as lanes and transposes at the end.
 *
 * Buffers: sinogram[count, slices, bins], table[along2, count, PHASES, columns], geometry[first + count, 4],
 * footprints[first + count, 8], views[first + count, 2]. */

#include "include/portable.h"
#include "include/tomo/phase_table.h"
#include "include/tomo/shadow.h"
#include "include/transpose.h"

KERNEL void radon_resample_edges(
    __global const real *restrict sinogram, __global real *restrict table,
    __global const long4 *restrict geometry, __global const real *restrict footprints,
    __global const int2 *restrict views, int first, int count, int slice0, int slices,
    int bins, int columns)
{
  const int k0 = (int)get_global_id(0) * LANES;
  const int number = (int)get_global_id(1), view = first + number;
  const int slice = (int)get_global_id(2);
  if (k0 >= views[view].y) return;
  const long4 g = run_upwards(geometry[view], bins);
  const int mirrored = geometry[view].w < 0;
  const view_shape shadow = shape_of_view(footprints, view);
  const long reach = (long)(4294967296.0f * shadow.HALF_WIDTH), to_edge = 1L << 31;
  const long lower = to_edge - reach, upper = to_edge + reach + g.w - (g.w >> LOG2_PHASES);
  /* As in radon_resample: columns take so many edges even where one of them is out of reach. */
  const int usual = WHOLE(upper - lower + (3L << 30));
  __global const real *y = sinogram + ((long)views[view].x * slices + slice0 + slice) * bins;
  lanes entries[PHASES];
  UNROLL for (int n = 0; n < PHASES; n++) {
    const int k = LANES == 1 ? k0 : k0 + n, phase = LANES == 1 ? n : 0;
    const long tau = g.z + k * g.w;
    const int near = WHOLE(tau + lower) + 1, last = WHOLE(tau + upper) + 1;
    const int far = near + usual > last ? near + usual : last;
    const int from = near > 0 ? near : 0, to = far <= bins ? far : bins + 1;
    real below = from > 0 && from <= bins ? y[PLACE(from - 1, mirrored, bins)] : 0;
    lanes sum = shadow.WHOLE_SHARE * below;
    for (int b = from; b < to; b++) {
      const real above = b < bins ? y[PLACE(b, mirrored, bins)] : 0;
      sum = sum + (above - below) * share(FROM_EDGE(g, k, phase, b), shadow);
      below = above;
    }
    entries[n] = shadow.SCALE * sum;
  }
  TRANSPOSE(entries)
  __global real *out = table + ((long)slice * count + number) * PHASES * columns + k0;
  UNROLL for (int r = 0; r < PHASES; r++) STORE(out + (long)r * columns, entries[r]);
}
