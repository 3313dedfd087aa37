/* The finest detail that any camera resolves at each splat: b = sqrt(0.2) min over cameras of depth / f.
 *
 * One pixel covers depth / f at a splat's depth; a Gaussian of variance 0.2 of that, squared, is what
 * Mip-Splatting (Yu et al. 2024, section 4.1) blurs a splat by. Only cameras count in whose image the
 * splat lies, or within MARGIN of its size round it. A splat that no camera sees gets `unseen`.
 * A camera has 20 numbers: the upper three rows of its view matrix, the longer of its focal lengths,
 * the principal point, width and height; of its aperture the radius, one over the distance in focus
 * and the wavelength, which are not looked at here.
 *
 * Index space: splats.
 *
 * Buffers: means[count, 3], cameras[views, NUMBERS], band[count]. */

#include "include/portable.h"
#include "include/small_matrix.h"

#define SHARE 0.4472136f
#define MARGIN 0.15f
#define NUMBERS 20
/* Coarser than anything. */
#define NOTHING 1e30f

KERNEL void splat_band(
    __global const float *restrict means, __global const float *restrict cameras,
    __global float *restrict band, float near_plane, float unseen, int views, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const float3 x = load3(means, i);
  float finest = NOTHING;
  for (int v = 0; v < views; v++) {
    __global const float *c = cameras + (long)v * NUMBERS;
    const float z = c[8] * x.x + c[9] * x.y + c[10] * x.z + c[11];
    if (!(z > near_plane)) continue;
    const float u = c[12] * (c[0] * x.x + c[1] * x.y + c[2] * x.z + c[3]) / z;
    const float w = c[12] * (c[4] * x.x + c[5] * x.y + c[6] * x.z + c[7]) / z;
    const float left = c[13], top = c[14], width = c[15], height = c[16];
    const float mx = MARGIN * width, my = MARGIN * height;
    const int seen = (u + left > -mx) & (u + left < width + mx) & (w + top > -my) & (w + top < height + my);
    if (seen && z / c[12] < finest) finest = z / c[12];
  }
  band[i] = finest < NOTHING ? SHARE * finest : unseen;
}
