/* Hermite modes to the screen: the table that the raster kernels read beside splat_project's.
 *
 *     screen_modes[i] = (i00, i10, i11, shape's c2_m, channels' c2_mc mode after mode),
 *
 * where i00, i10, i11 are the rows of L^-1 (include/hermite_project.h derives it and c2). Channels
 * pass by the same map as the shape, each for itself; the constants, 1 and the features, stay as
 * they are and are not in the table. Splats that are not drawn get zeros. Index space: splats. */

/* One splat at a time: the modes of eight would fill more registers than there are. */
#undef LANES
#define LANES 1
#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/camera.h"
#include "include/aperture.h"
#include "include/gaussian.h"
#include "include/hermite_project.h"

/* One order of one polynomial, from entries `stride` apart to entries as far apart. */
static void project_order(
    const Whitening *w, __global const float *modes, int order, int stride, __global float *out)
{
  float tensor[TENSOR_LENGTH];
  load_order(tensor, modes, order, stride);
  contract_order(tensor, w, order, order);
  const float *row = tensor;
  for (int j = 0; j <= order; j++) {
    out[j * stride] = row[0] / factor_on_screen(order, j);
    row += MODES2(order - j);
  }
}

KERNEL void hermite_project(
    __global const float *restrict means, SHAPES, __global const float *restrict shape_modes,
    __global const float *restrict color_modes, __global const uchar *restrict culled,
    __global float *restrict screen_modes, CAMERA_PARAMETERS,
    float near_plane, float far_plane, float eps2d, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  __global float *out = screen_modes + i * TABLE_LENGTH;
  if (culled[i] != VISIBLE) {
    for (int k = 0; k < TABLE_LENGTH; k++) out[k] = 0;
    return;
  }
  Gaussian g;
  see_gaussian(&g, CAMERA, means, SHAPE, rows_at(i, count), near_plane, far_plane, eps2d);
  const Whitening w = whiten(&g);
  out[0] = w.i00;
  out[1] = w.i10;
  out[2] = w.i11;
  out += WHITENING;
  __global const float *shape = shape_modes + i * SHAPE_MODES;
  for (int order = 1; order <= SHAPE_ORDER; order++)
    project_order(&w, shape + MODES3(order - 1) - 1, order, 1, out + MODES2(order - 1) - 1);
  out += SCREEN_SHAPE_MODES;
  __global const float *color = color_modes + i * COLOR_MODES * COLOR_CHANNELS;
  for (int order = 1; order <= COLOR_ORDER; order++)
    for (int c = 0; c < COLOR_CHANNELS; c++)
      project_order(
          &w, color + (MODES3(order - 1) - 1) * COLOR_CHANNELS + c, order, COLOR_CHANNELS,
          out + (MODES2(order - 1) - 1) * COLOR_CHANNELS + c);
}
