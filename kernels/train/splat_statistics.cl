/* What densification knows of each splat, gathered frame by frame (Kerbl et al. 2023, gsplat 1.5).
 *
 *     statistics[i] = (sum of |(dL/du width/2, dL/dv height/2)|, frames it was seen in,
 *                      its largest radius as a share of the image's larger side),
 *
 * where (u, v) is the splat's place on the screen in pixels, so that the gradient is by the place
 * in an image that reaches from -1 to 1 along both sides. The radius is the larger half side of
 * the rectangle round all that is drawn of the splat, not rounded to pixels.
 *
 * A splat that is not drawn in this frame, or whose gradient is not finite, keeps what it has: one
 * broken frame must neither grow it nor hide it. Index space: splats.
 *
 * Buffers: grad_means2d[count, 2], screen[count, 8], culled[count], statistics[count, 3]. */

#include "include/portable.h"
#include "include/small_matrix.h"

KERNEL void splat_statistics(
    __global const float *restrict grad_means2d, __global const float *restrict screen,
    __global const uchar *restrict culled, __global float *restrict statistics,
    float half_width, float half_height, float radius_share, int count)
{
  const long i = get_global_id(0);
  if (i >= count || culled[i]) return;
  const float x = half_width * grad_means2d[2 * i], y = half_height * grad_means2d[2 * i + 1];
  const float magnitude = sqrt(x * x + y * y);
  if (not_finite(magnitude)) return;
  const float across = screen[8 * i + 6], down = screen[8 * i + 7];
  const float radius = radius_share * (across > down ? across : down);
  const float3 before = load3(statistics, i);
  const float largest = radius > before.z ? radius : before.z;
  store3(statistics, i, (float3)(before.x + magnitude, before.y + 1, largest));
}
