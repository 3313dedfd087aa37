/* Gradient of splat_shade: to the coefficients, and through the direction to mean and camera.
 *
 * The latter, told in include/shading/seen_color.h, are added to grad_means and to this run's row
 * of camera_parts. inverse_x, _y, _z are the rows of W^-T, each followed by a coordinate of o. A
 * colour that was held at zero passes nothing on, and so no splat that is not drawn.
 *
 * With ADAM the coefficients take a step here and now (include/train/adam_step.h), in place of grad_sh: also
 * those of splats that nothing comes in for, which go on by their moments.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means, grad_means[count, 3], sh, grad_sh, m, v[count, COEFFICIENTS, 3],
 * shares[period + LANES - 1], features, grad_features[count, STRIDE],
 * camera_parts[CAMERA_GRADIENT ? 16 : 0, (count + RUN - 1) / RUN]. */

#include "include/portable.h"
#include "include/shading/seen_color.h"
#include "include/shading/sh.h"

KERNEL void splat_shade_grad(
    __global const float *restrict means, __global float *restrict sh,
    __global const float *restrict features, __global const float *restrict grad_features,
    float4 inverse_x, float4 inverse_y, float4 inverse_z, int count,
#if ADAM
    ADAM_PARAMETERS,
#else
    __global float *restrict grad_sh,
#endif
    __global float *restrict grad_means, __global float *restrict camera_parts)
{
#if ADAM
  const Adam adam = ADAM_GIVEN;
#endif
  const float3 center = (float3)(inverse_x.w, inverse_y.w, inverse_z.w);
  lanes3 by_means = lanes3_of(0, 0, 0);
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes3 color = read3(features, STRIDE, rows);
    ask_ahead(sh, COEFFICIENTS, rows);
    const lanes_int seen = is_seen(color) & are_there(rows);
    const lanes3 incoming = incoming_of(color, read3(grad_features, STRIDE, rows));
    lanes basis[COEFFICIENTS], by_basis[COEFFICIENTS], by_sh[3 * COEFFICIENTS];
    const Sight s = sight_of(read3(means, 3, rows), center);
    sh_basis(s.direction, basis);
    coefficients_grad(COEFFICIENTS, basis, incoming, by_sh);
    if (any_lane(seen)) {
      functions_grad(sh, COEFFICIENTS, rows, incoming, by_basis);
      const lanes3 by_mean = mean_grad(sh_basis_grad(s.direction, by_basis), s, seen);
      add_to_means(grad_means, rows, by_mean);
      by_means = plus(by_means, by_mean);
    }
#if ADAM
    step_coefficients(sh, COEFFICIENTS, rows, by_sh, adam);
#else
    write_kept(grad_sh, 3 * COEFFICIENTS, rows, by_sh);
#endif
  }
  if (HAS_RUN(count)) add_to_camera(by_means, inverse_x, inverse_y, inverse_z, camera_parts);
}
