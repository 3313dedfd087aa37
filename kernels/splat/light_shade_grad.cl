/* Gradient of light_shade: to normals and reflectances, and through the direction to mean and camera.
 *
 * With q_k = sum over channels of incoming tint A_k, E_k = exp(s (a_k . r - 1)) and the names of
 * include/shading/reflection.h
 *
 *     dL/dr = w s sum over k of E_k q_k a_k,
 *     dL/ds = sum over k of E_k q_k (1 / g + w (a_k . r - 1)),    ds/d(ln kappa) = s g / (g + kappa),
 *
 * and r = d - 2 (d . n) n takes dL/dr to d and to n. A normal's length only divides its gradient.
 * Those of mean and camera, told in include/shading/seen_color.h, are added to grad_means and to this run's
 * row of camera_parts. A colour that was held at zero passes nothing on.
 *
 * For the light's gradient (light_grad.cl) a row of ARRIVAL numbers of each splat is written: r,
 * s in powers of two, w times incoming times tint, a gap; zeros where there is none.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means, normals, grad_means, grad_normals[count, 3], reflectance,
 * grad_reflectance[count, REFLECTANCE], features, grad_features[count, STRIDE],
 * lobes[lobe_count, LIGHT_ROW], arrivals[count, ARRIVAL],
 * camera_parts[CAMERA_GRADIENT ? 16 : 0, (count + RUN - 1) / RUN]. */

#include "include/portable.h"
#include "include/shading/reflection.h"

#define ARRIVAL 8

KERNEL void light_shade_grad(
    __global const float *restrict means, __global const float *restrict normals,
    __global const float *restrict reflectance, __global const float *restrict features,
    __global const float *restrict grad_features, __global const float *restrict lobes,
    float4 inverse_x, float4 inverse_y, float4 inverse_z, float lattice, int lobe_count, int count,
    __global float *restrict grad_normals, __global float *restrict grad_reflectance,
    __global float *restrict arrivals, __global float *restrict grad_means,
    __global float *restrict camera_parts)
{
  const float3 center = (float3)(inverse_x.w, inverse_y.w, inverse_z.w);
  lanes3 by_means = lanes3_of(0, 0, 0);
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes3 color = read3(features, STRIDE, rows);
    const lanes_int seen = is_seen(color) & are_there(rows);
    lanes by[REFLECTANCE], arrival[ARRIVAL];
    UNROLL for (int k = 0; k < REFLECTANCE; k++) by[k] = 0;
    UNROLL for (int k = 0; k < ARRIVAL; k++) arrival[k] = 0;
    lanes3 by_normal = lanes3_of(0, 0, 0);
    if (any_lane(seen)) {
      const Sight sight = sight_of(read3(means, 3, rows), center);
      const lanes3 d = sight.direction, incoming = incoming_of(color, read3(grad_features, STRIDE, rows));
      lanes numbers[REFLECTANCE];
      Reflection m;
      read_columns(reflectance, REFLECTANCE, 0, REFLECTANCE, rows, numbers);
      const lanes_int meant = read_reflection(&m, normals, numbers, rows, d, lattice) & seen;
      const lanes3 pull = each_times(incoming, tint_of(&m));
      const lanes steep = LOG2_OF_E * m.s;
      lanes3 light = lanes3_of(0, 0, 0), way = lanes3_of(0, 0, 0);
      lanes sum = 0, bend = 0;
      for (int k = 0; k < lobe_count; k++) {
        __global const float *lobe = lobes + LIGHT_ROW * k;
        const lanes near = dot_with((float3)(lobe[0], lobe[1], lobe[2]), m.mirrored) - 1;
        const lanes e = two_to_the(steep * near);
        const lanes q = e * dot_with((float3)(lobe[4], lobe[5], lobe[6]), pull);
        light.x += e * lobe[4];
        light.y += e * lobe[5];
        light.z += e * lobe[6];
        way.x += q * lobe[0];
        way.y += q * lobe[1];
        way.z += q * lobe[2];
        sum += q;
        bend += q * near;
      }
      const lanes by_s = sum / lattice + m.w * bend;
      const lanes3 by_mirrored = times(m.w * m.s, way);
      const lanes3 by_tint = each_times(incoming, times(m.w, light));
      const lanes3 by_grazing = times(m.rim, by_tint);
      by[0] = by_tint.x * m.tint.x * (1 - m.tint.x);
      by[1] = by_tint.y * m.tint.y * (1 - m.tint.y);
      by[2] = by_tint.z * m.tint.z * (1 - m.tint.z);
      by[3] = by_grazing.x * m.grazing.x * (1 - m.grazing.x);
      by[4] = by_grazing.y * m.grazing.y * (1 - m.grazing.y);
      by[5] = by_grazing.z * m.grazing.z * (1 - m.grazing.z);
      by[6] = if_free(numbers[6], -MOST_LOG_KAPPA, MOST_LOG_KAPPA, by_s * m.s * (1 - m.w));
      UNROLL for (int k = 0; k < REFLECTANCE; k++) by[k] = meant ? by[k] : 0;
      const lanes square = m.edge * m.edge;
      const lanes rise = 5 * square * square * dot_of(by_tint, m.grazing);
      const lanes by_facing = m.facing > 0 ? -rise : rise;
      const lanes along = 2 * dot_of(m.normal, by_mirrored);
      const lanes3 by_unit = minus(times(by_facing - along, d), times(2 * m.facing, by_mirrored));
      const lanes3 across = minus(by_unit, times(dot_of(by_unit, m.normal), m.normal));
      by_normal = where(meant, times(m.inverse, across));
      const lanes3 by_direction = plus(by_mirrored, times(by_facing - along, m.normal));
      const lanes3 by_mean = mean_grad(by_direction, sight, meant);
      add_to_means(grad_means, rows, by_mean);
      by_means = plus(by_means, by_mean);
      const lanes3 mirrored = where(meant, m.mirrored), arriving = where(meant, times(m.w, pull));
      arrival[0] = mirrored.x;
      arrival[1] = mirrored.y;
      arrival[2] = mirrored.z;
      arrival[3] = meant ? steep : 0;
      arrival[4] = arriving.x;
      arrival[5] = arriving.y;
      arrival[6] = arriving.z;
    }
    write3(grad_normals, 3, rows, by_normal);
    write_columns(grad_reflectance, REFLECTANCE, 0, REFLECTANCE, rows, by);
    write_columns(arrivals, ARRIVAL, 0, ARRIVAL, rows, arrival);
  }
  if (HAS_RUN(count)) add_to_camera(by_means, inverse_x, inverse_y, inverse_z, camera_parts);
}
