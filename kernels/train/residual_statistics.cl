/* What each splat shows of the residual and of the image, gathered view by view.
 *
 *     statistics[i] += (residual that it shows, pixels that it makes up, 1),
 *
 * where the first two stand side by side in row i of `sums`, from column `first` on: the gradient of
 * the image of residual_image.cl. A splat that a view does not look at (code 1 or 4 of what leaves
 * splats out of a frame: out of depth, off the screen) keeps what it has, and so does one whose sums
 * are not finite. One that is too faint to be drawn was looked at and shows nothing. Index space:
 * splats.
 *
 * Buffers: sums[count, width], culled[count], statistics[count, 3]. */

#include "include/portable.h"
#include "include/small_matrix.h"

#define OUT_OF_DEPTH 1
#define OFF_SCREEN 4

KERNEL void residual_statistics(
    __global const float *restrict sums, __global const uchar *restrict culled,
    __global float *restrict statistics, int width, int first, int count)
{
  const long i = get_global_id(0);
  if (i >= count || culled[i] == OUT_OF_DEPTH || culled[i] == OFF_SCREEN) return;
  const float shown = sums[i * width + first], made = sums[i * width + first + 1];
  if (not_finite(shown + made)) return;
  const float3 before = load3(statistics, i);
  store3(statistics, i, (float3)(before.x + shown, before.y + made, before.z + 1));
}
