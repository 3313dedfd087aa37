/* Move splats at random, within their own shape and the more the fainter they are: Langevin noise.
 *
 *     mean += amount gate(opacity) Sigma xi,   gate(o) = 1 / (1 + exp(100 (o - 0.005))),
 *
 * with xi standard normal (3DGS as MCMC, Kheradmand et al. 2024; constants of gsplat). Numbers are
 * made from (splat, step, seed) alone by a hash (PCG4D, Jarzynski and Olano 2020) and Box and
 * Muller's transform, so that a run can be repeated and taken up again. Index space: splats. */

#include "include/portable.h"
#include "include/small_matrix.h"

#define STEEPNESS 100.0f
#define FAINT 0.005f
#define TWO_PI 6.2831853f

static uint4 scramble(uint4 v) {
  v = v * 1664525u + 1013904223u;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  v ^= v >> 16;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return v;
}

/* In (0, 1). */
static float fraction(uint bits) { return ((bits >> 8) + 0.5f) * (1.0f / 16777216.0f); }

static float3 normal3(uint4 bits) {
  const float near = sqrt(-2 * log(fraction(bits.x))), far = sqrt(-2 * log(fraction(bits.z)));
  const float turn = TWO_PI * fraction(bits.y);
  return (float3)(near * cos(turn), near * sin(turn), far * cos(TWO_PI * fraction(bits.w)));
}

KERNEL void splat_noise(
    __global float *restrict means, __global const float *restrict quats,
    __global const float *restrict scales, __global const float *restrict opacities,
    float amount, uint seed, uint step, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const float gate = 1 / (1 + exp(STEEPNESS * (opacities[i] - FAINT)));
  const float4 q = (float4)(quats[4 * i + 1], quats[4 * i + 2], quats[4 * i + 3], quats[4 * i]);
  const float length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!(length > 0)) return;
  const float3 v = q.xyz / length, s = load3(scales, i);
  const float w = q.w / length;
  const float3 xi = normal3(scramble((uint4)((uint)i, step, seed, 0x9e3779b9u)));
  /* Sigma xi = R S^2 R^T xi, rotations by v x (..) twice. */
  const float3 once = cross3(v, xi), back = xi - 2 * (w * once - cross3(v, once));
  const float3 grown = back * s * s;
  const float3 turned = cross3(v, grown);
  const float3 move = grown + 2 * (w * turned + cross3(v, turned));
  store3(means, i, load3(means, i) + amount * gate * move);
}
