/* Gradient of light_shade by the logarithms of the light's radiance: a chunk of the splats each.
 *
 *     dL/d(ln A_k) = A_k sum over splats of w exp(s (a_k . r - 1)) incoming tint,
 *
 * channel by channel, from the rows that light_shade_grad.cl leaves of each splat. The sum over
 * CHUNK splats goes in their order to a row of parts, 3 numbers for each lobe; sum_columns adds the
 * rows, so that equal splats give equal bits. The lanes are lobes here: a splat's numbers are the
 * same for all of them, and nothing is exchanged. Index space: (lobes by LANES, chunks).
 *
 * Buffers: arrivals[count, ARRIVAL], lobes[lobe_count, LIGHT_ROW], parts[along1, lobe_count, 3]. */

#include "include/portable.h"
#include "include/shading/reflection.h"

#define ARRIVAL 8
#ifndef CHUNK
#define CHUNK 512
#endif

KERNEL void light_grad(
    __global const float *restrict arrivals, __global const float *restrict lobes,
    __global float *restrict parts, int lobe_count, int count)
{
  const long first = (long)get_global_id(0) * LANES, chunk = get_global_id(1);
  if (first >= lobe_count) return;
  const Rows rows = rows_at(first, lobe_count);
  lanes lobe[LIGHT_ROW];
  read_columns(lobes, LIGHT_ROW, 0, LIGHT_ROW, rows, lobe);
  const lanes3 axis = lanes3_of(lobe[0], lobe[1], lobe[2]);
  lanes3 sum = lanes3_of(0, 0, 0);
  const long end = (chunk + 1) * CHUNK < count ? (chunk + 1) * CHUNK : count;
  for (long i = chunk * CHUNK; i < end; i++) {
    __global const float *arrival = arrivals + ARRIVAL * i;
    /* Half of the splats stand behind others. */
    if (arrival[4] == 0 && arrival[5] == 0 && arrival[6] == 0) continue;
    const lanes near = dot_with((float3)(arrival[0], arrival[1], arrival[2]), axis) - 1;
    const lanes e = two_to_the(arrival[3] * near);
    sum.x += e * arrival[4];
    sum.y += e * arrival[5];
    sum.z += e * arrival[6];
  }
  const lanes3 radiance = lanes3_of(lobe[4], lobe[5], lobe[6]);
  write3(parts + 3 * chunk * lobe_count, 3, rows, each_times(radiance, sum));
}
