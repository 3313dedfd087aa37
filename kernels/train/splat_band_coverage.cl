/* The finest detail that all cameras together resolve at each splat, by how often they see it.
 *
 * Views of a target of diameter D know a frequency k in slabs 1 / D thick; over all directions of k
 * that is a share sqrt(pi / 32) / (D k) for each (rho^2 = exp(-8 (D u)^2), as in coverage), times
 * what its optics pass, up to half a cycle per pixel. Times snr (D k)^-2, the signal to noise of a
 * power law, it is above 1 where the cameras know more than noise. The last such k sets the band
 *
 *     b = sqrt(0.2) / (2 k),
 *
 * which is splat_band's for the k of half a cycle per pixel of the finest camera: where views are many
 * and clean, both agree. Cameras are numbers as splat_band has them.
 *
 * Index space: (runs of LANES splats).
 *
 * Buffers: means[count, 3], cameras[views, NUMBERS], band[count]. */

#include "include/portable.h"
#include "include/sampling/optical_transfer.h"

#define SHARE 0.4472136f
#define MARGIN 0.15f
#define NUMBERS 20
#define SPREAD 0.31332853f
#define NOTHING 1e30f
/* Halvings of the logarithm of the range of frequencies. */
#define HALVINGS 8

typedef struct {
  lanes x, y, z;
} points;

/* The object pixel of a camera at each point, NOTHING where it is not seen. */
static lanes pixel_at(__global const float *c, points p, float near_plane)
{
  const lanes depth = c[8] * p.x + c[9] * p.y + c[10] * p.z + c[11];
  const lanes z = depth > near_plane ? depth : 1;
  const lanes u = c[12] * (c[0] * p.x + c[1] * p.y + c[2] * p.z + c[3]) / z + c[13];
  const lanes v = c[12] * (c[4] * p.x + c[5] * p.y + c[6] * p.z + c[7]) / z + c[14];
  const float mx = MARGIN * c[15], my = MARGIN * c[16];
  const lanes_int seen = (depth > near_plane) & (u > -mx) & (u < c[15] + mx) & (v > -my) & (v < c[16] + my);
  return seen ? z / c[12] : NOTHING;
}

/* Signal to noise of what all cameras know at frequencies k. */
static lanes known(
    __global const float *cameras, points p, lanes k, float near_plane, float diameter, float snr, int views)
{
  lanes sum = 0;
  for (int j = 0; j < views; j++) {
    __global const float *c = cameras + (long)j * NUMBERS;
    const lanes a = pixel_at(c, p, near_plane);
    const lanes_int resolved = a * k <= 0.5f;
    const lanes t = resolved ? a * k : 0.5f;
    lanes passed = square_pixel(half_turn_of(t), t);
    if (c[17] > 0) {
      const lanes z = a * c[12], v = k * z * c[19] / (2 * c[17]);
      const lanes b = 2 * c[17] * absolute(1 - z * c[18]) * k * (1 - v);
      const lanes disc = (resolved & (b > 1e-6f)) ? b : 1e-6f;
      passed *= defocus(half_turn_of(disc), disc) * diffraction(v);
    }
    sum += resolved ? passed * passed : 0;
  }
  const lanes q = diameter * k;
  return SPREAD * snr * sum / (q * q * q);
}

KERNEL void splat_band_coverage(
    __global const float *restrict means, __global const float *restrict cameras,
    __global float *restrict band, float near_plane, float unseen, float diameter, float snr, int views,
    int count)
{
  const int first = (int)get_global_id(0) * LANES;
  if (first >= count) return;
  lanes_int i = first + TO_INT(LANE_NUMBERS);
  i = 3 * (i < count ? i : count - 1);
  points p;
  p.x = GATHER(means, i);
  p.y = GATHER(means, i + 1);
  p.z = GATHER(means, i + 2);
  lanes finest = NOTHING;
  for (int j = 0; j < views; j++) {
    const lanes a = pixel_at(cameras + (long)j * NUMBERS, p, near_plane);
    finest = a < finest ? a : finest;
  }
  /* A hair below half a cycle per pixel, lest rounding leaves the finest camera out. */
  lanes high = 0.499999f / finest, low = 1 / diameter + 0 * finest;
  const lanes_int whole = known(cameras, p, high, near_plane, diameter, snr, views) > 1;
  low = (whole | (high < low)) ? high : low;
  for (int n = 0; n < HALVINGS; n++) {
    const lanes k = sqrt(low * high);
    const lanes_int more = known(cameras, p, k, near_plane, diameter, snr, views) > 1;
    low = more ? k : low;
    high = more ? high : k;
  }
  const lanes found = finest < NOTHING ? SHARE * 0.5f / low : unseen;
  for (int n = 0; n < LANES && first + n < count; n++) band[first + n] = ((const float *)&found)[n];
}
