/* Composite the splats of a tile front to back; driver for CPUs (see include/splat.h).
 *
 *     light: C = sum of w c + T background,  w = alpha T,  T the product of (1 - alpha) so far;
 *     ADDITIVE: C = sum of weight exp(-sigma) c, whatever the order (line integrals of X-rays).
 *
 * Index space: (tiles). Each item owns one tile, whose pixels lie in strips of LANES columns. For
 * each splat only the strips and rows that its box touches are visited; strips are fixed, so that
 * every load and store of a pixel's state is aligned to where it was stored. A finished pixel
 * keeps its transmittance with the sign turned. Work stops when all pixels are finished.
 *
 * A pixel and a splat have `stride` channels, of which this launch does CHANNELS from `first`.
 * Written for each pixel: image (CHANNELS numbers), the final transmittance, and one more than
 * the last entry that counted, where the gradient begins its way back. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/splat.h"

#define STRIPS (TILE / LANES)
#define PIXELS (STRIPS * TILE)
/* Splats between two looks at whether the tile is finished. */
#define PATIENCE 16

#if ADDITIVE || SMOOTH
#define FINISHED(left) 0
#else
#define FINISHED(left) finished(left)
static int finished(const lanes *left) {
  lanes most = left[0];
  for (int p = 1; p < PIXELS; p++) most = left[p] > most ? left[p] : most;
  for (int lane = 0; lane < LANES; lane++)
    if (((const float *)&most)[lane] > 0) return 0;
  return 1;
}
#endif

KERNEL void splat_raster_cpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict screen,
    __global const int2 *restrict radii, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, float cap, int stride, int first)
{
  const int tile = (int)get_global_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  lanes left[PIXELS], color[CHANNELS][PIXELS];
  lanes_int end[PIXELS];
  for (int p = 0; p < PIXELS; p++) {
    left[p] = 1;
    end[p] = 0;
    for (int n = 0; n < CHANNELS; n++) color[n][p] = 0;
  }
  for (int entry = starts[tile]; entry < starts[tile + 1]; entry++) {
    const int splat = entries[entry].x;
    __global const float *s = screen + 8 * splat;
    __global const float *feature = features + (long)splat * stride + first;
    const float mean_x = s[0], mean_y = s[1], weight = s[5];
    const float a = 0.5f * s[2], b = s[3], c = 0.5f * s[4];
    const int2 radius = radii[splat];
    const int row0 = (int)(mean_y - radius.y) - 1 - y0, row1 = (int)(mean_y + radius.y) + 1 - y0;
    const int top = row0 > 0 ? row0 : 0, bottom = row1 < TILE ? row1 : TILE;
    if ((entry - starts[tile]) % PATIENCE == PATIENCE - 1 && FINISHED(left)) break;
    for (int strip = 0; strip < STRIPS; strip++) {
      const float left_edge = (float)(x0 + strip * LANES);
      if (left_edge > mean_x + radius.x || left_edge + LANES < mean_x - radius.x) continue;
      const lanes dx = (mean_x - left_edge - 0.5f) - LANE_NUMBERS;
      const lanes quadratic = a * dx * dx, linear = b * dx;
      for (int row = top; row < bottom; row++) {
        const int p = strip * TILE + row;
        const float dy = mean_y - (float)(y0 + row) - 0.5f;
        const lanes sigma = quadratic + linear * dy + c * dy * dy;
#if ADDITIVE
        const lanes w = weight * falloff(sigma);
#else
        lanes alpha = weight * falloff(sigma);
#if !SMOOTH
        alpha = alpha < cap ? alpha : cap;
        alpha = alpha < FAINTEST ? 0 : alpha;
        alpha = sigma < 0 ? 0 : alpha;
#endif
        const lanes t = left[p], w_here = alpha * t, next = t - w_here;
#if SMOOTH
        const lanes w = w_here;
        left[p] = next;
        end[p] = entry + 1;
#else
        /* A finished pixel has t < 0, and so has w_here. */
        const lanes w = next > OPAQUE && t > 0 ? w_here : 0;
        left[p] = w > 0 ? next : (alpha > 0 && t > 0 ? -t : t);
        end[p] = w > 0 ? entry + 1 : end[p];
#endif
#endif
        UNROLL for (int n = 0; n < CHANNELS; n++) color[n][p] = color[n][p] + w * feature[n];
      }
    }
  }
  for (int p = 0; p < PIXELS; p++) {
    const int y = y0 + p % TILE, x = x0 + p / TILE * LANES;
    for (int lane = 0; lane < LANES && x + lane < width && y < height; lane++) {
      const long pixel = (long)y * width + x + lane;
      const float t = ((const float *)&left[p])[lane], rest = t < 0 ? -t : t;
      transmittance[pixel] = rest;
      last[pixel] = ((const int *)&end[p])[lane];
      for (int n = 0; n < CHANNELS; n++)
        image[pixel * stride + first + n] =
            ((const float *)&color[n][p])[lane] + (ADDITIVE ? 0 : rest * background[first + n]);
    }
  }
}
