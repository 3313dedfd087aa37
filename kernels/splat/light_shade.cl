/* What splats reflect of a light that they share: include/shading/reflection.h says how much.
 *
 * It is written to the first three of STRIDE features, to which the kernels of the splats' own
 * colours (splat_shade, lobe_shade with LIT 1) add theirs. Splats that are not drawn reflect nothing.
 *
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means, normals[count, 3], reflectance[count, REFLECTANCE], culled[count],
 * lobes[lobe_count, LIGHT_ROW], features[count, STRIDE]. */

#include "include/portable.h"
#include "include/shading/reflection.h"

KERNEL void light_shade(
    __global const float *restrict means, __global const float *restrict normals,
    __global const float *restrict reflectance, __global const uchar *restrict culled,
    __global const float *restrict lobes, __global float *restrict features, float4 center,
    float lattice, int lobe_count, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes_int drawn = read_bytes(culled, rows) == 0;
    lanes3 color = lanes3_of(0, 0, 0);
    if (any_lane(drawn)) {
      const lanes3 d = sight_of(read3(means, 3, rows), center.xyz).direction;
      lanes numbers[REFLECTANCE];
      Reflection m;
      read_columns(reflectance, REFLECTANCE, 0, REFLECTANCE, rows, numbers);
      const lanes_int meant = read_reflection(&m, normals, numbers, rows, d, lattice);
      const lanes steep = LOG2_OF_E * m.s;
      lanes3 light = lanes3_of(0, 0, 0);
      for (int k = 0; k < lobe_count; k++) {
        __global const float *lobe = lobes + LIGHT_ROW * k;
        const lanes near = dot_with((float3)(lobe[0], lobe[1], lobe[2]), m.mirrored) - 1;
        const lanes e = two_to_the(steep * near);
        light.x += e * lobe[4];
        light.y += e * lobe[5];
        light.z += e * lobe[6];
      }
      color = where(drawn & meant, each_times(tint_of(&m), times(m.w, light)));
    }
    write3(features, STRIDE, rows, color);
  }
}
