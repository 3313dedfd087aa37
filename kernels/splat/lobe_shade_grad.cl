/* Gradient of lobe_shade: to linear coefficients and lobes, and through the direction to mean and
 * camera.
 *
 * The first is B_k times what comes in; the lobes' is derived in include/shading/lobe*.h. Those of mean and
 * camera, told in include/shading/seen_color.h, are added to grad_means and to this run's row of
 * camera_parts. inverse_x, _y, _z are the rows of W^-T, each followed by a coordinate of o. A colour
 * that was held at zero passes nothing on, and so no splat that is not drawn. With ADAM the linear
 * coefficients take a step here and now (include/train/adam_step.h), in place of grad_linear.
 *
 * Index space: (runs of RUN splats), LANES of them at a time. Each splat has 3 FUNCTIONS + GEOMETRY + 9
 * numbers that are read, 3 FUNCTIONS + GEOMETRY that are written, and 3 of its mean that are both.
 *
 * Buffers: means, grad_means[count, 3], linear, grad_linear, m, v[count, FUNCTIONS, 3],
 * shares[period + LANES - 1], lobes, grad_lobes[count, GEOMETRY], features, grad_features[count, STRIDE],
 * camera_parts[CAMERA_GRADIENT ? 16 : 0, (count + RUN - 1) / RUN]. */

#include "include/portable.h"
#include "include/shading/seen_color.h"
#include "include/shading/lobe.h"

KERNEL void lobe_shade_grad(
    __global const float *restrict means, __global float *restrict linear,
    __global const float *restrict lobes, __global const float *restrict features,
    __global const float *restrict grad_features, float4 inverse_x, float4 inverse_y,
    float4 inverse_z, int count,
#if ADAM
    ADAM_PARAMETERS,
#else
    __global float *restrict grad_linear,
#endif
    __global float *restrict grad_lobes, __global float *restrict grad_means,
    __global float *restrict camera_parts)
{
#if ADAM
  const Adam adam = ADAM_GIVEN;
#endif
  const float3 center = (float3)(inverse_x.w, inverse_y.w, inverse_z.w);
  lanes3 by_means = lanes3_of(0, 0, 0);
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes3 color = read3(features, STRIDE, rows);
    const lanes_int seen = is_seen(color) & are_there(rows);
    const lanes3 incoming = incoming_of(color, read3(grad_features, STRIDE, rows));
    lanes lobe[GEOMETRY], by_lobe[GEOMETRY], basis[FUNCTIONS], by_basis[FUNCTIONS], by_linear[3 * FUNCTIONS];
    const Sight s = sight_of(read3(means, 3, rows), center);
    read_columns(lobes, GEOMETRY, 0, GEOMETRY, rows, lobe);
    functions_grad(linear, FUNCTIONS, rows, incoming, by_basis);
    const lanes3 g = lobe_functions_grad(lobe, s.direction, by_basis + 1, basis + 1, by_lobe);
    /* Geometries without a meaning, which are not seen, give no numbers. */
    basis[0] = CONSTANT;
    for (int k = 1; k < FUNCTIONS; k++) basis[k] = seen ? basis[k] : 0;
    for (int k = 0; k < GEOMETRY; k++) by_lobe[k] = seen ? by_lobe[k] : 0;
    coefficients_grad(FUNCTIONS, basis, incoming, by_linear);
#if ADAM
    step_coefficients(linear, FUNCTIONS, rows, by_linear, adam);
#else
    write_kept(grad_linear, 3 * FUNCTIONS, rows, by_linear);
#endif
    write_columns(grad_lobes, GEOMETRY, 0, GEOMETRY, rows, by_lobe);
    const lanes3 by_mean = mean_grad(g, s, seen);
    add_to_means(grad_means, rows, by_mean);
    by_means = plus(by_means, by_mean);
  }
  if (HAS_RUN(count)) add_to_camera(by_means, inverse_x, inverse_y, inverse_z, camera_parts);
}
