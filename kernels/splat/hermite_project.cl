/* Hermite modes to the screen: the table that the raster kernels read beside splat_project's.
 *
 *     screen_modes[i] = (i00, i10, i11, shape's c2_m, channels' c2_mc mode after mode),
 *
 * where i00, i10, i11 are the rows of L^-1 (include/projection/hermite_project.h derives it and
 * c2). Channels pass by the same map as the shape, each for itself; the constants, 1 and the
 * features, stay as they are and are not in the table. Splats that are not drawn get zeros.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means[count, 3], quats[count, 4], scales[count, 3], covars[count, 6],
 * shape_modes[count, SHAPE_MODES], color_modes[count, COLOR_MODES, COLOR_CHANNELS], culled[count],
 * screen_modes[count, TABLE_LENGTH]. */

#include "include/portable.h"
#include "include/projection/camera.h"
#include "include/projection/aperture.h"
#include "include/projection/gaussian.h"
#include "include/projection/hermite_project.h"

/* One order of one polynomial, from its columns to those of the table. */
static void project_order(
    const Whitening *w, __global const float *modes, const Columns at, Rows rows, lanes_int drawn, int order,
    __global float *table, const Columns to)
{
  lanes tensor[TENSOR_LENGTH];
  load_order(tensor, modes, at, rows, order);
  contract_order(tensor, w, order, order);
  const lanes *row = tensor;
  for (int j = 0; j <= order; j++) {
    const lanes mode = row[0] * (1 / factor_on_screen(order, j));
    write_one(table, to.width, to.first + j * to.stride, rows, drawn ? mode : 0);
    row += MODES2(order - j);
  }
}

KERNEL void hermite_project(
    __global const float *restrict means, SHAPES, __global const float *restrict shape_modes,
    __global const float *restrict color_modes, __global const uchar *restrict culled,
    __global float *restrict screen_modes, CAMERA_PARAMETERS,
    float near_plane, float far_plane, float eps2d, int count)
{
  const Camera camera = CAMERA;
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = read_bytes(culled, rows) == VISIBLE;
    Gaussian g;
    see_gaussian(&g, camera, means, SHAPE, rows, near_plane, far_plane, eps2d);
    const Whitening w = whiten(&g);
    write_one(screen_modes, TABLE_LENGTH, 0, rows, drawn ? w.i00 : 0);
    write_one(screen_modes, TABLE_LENGTH, 1, rows, drawn ? w.i10 : 0);
    write_one(screen_modes, TABLE_LENGTH, 2, rows, drawn ? w.i11 : 0);
    UNROLL for (int order = 1; order <= SHAPE_ORDER; order++) {
      const Columns at = columns_of(SHAPE_MODES, MODES3(order - 1) - 1, 1);
      const Columns to = columns_of(TABLE_LENGTH, WHITENING + MODES2(order - 1) - 1, 1);
      project_order(&w, shape_modes, at, rows, drawn, order, screen_modes, to);
    }
    for (int order = 1; order <= COLOR_ORDER; order++)
      for (int c = 0; c < COLOR_CHANNELS; c++) {
        const int from = (MODES3(order - 1) - 1) * COLOR_CHANNELS + c;
        const int onto = WHITENING + SCREEN_SHAPE_MODES + (MODES2(order - 1) - 1) * COLOR_CHANNELS + c;
        const Columns at = columns_of(COLOR_MODES * COLOR_CHANNELS, from, COLOR_CHANNELS);
        const Columns to = columns_of(TABLE_LENGTH, onto, COLOR_CHANNELS);
        project_order(&w, color_modes, at, rows, drawn, order, screen_modes, to);
      }
  }
}
