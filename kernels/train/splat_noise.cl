/* Move splats at random, within their own shape and the more the fainter they are: Langevin noise.
 *
 *     mean += amount gate(opacity) Sigma xi,   gate(o) = 1 / (1 + exp(100 (o - 0.005))),
 *
 * with xi standard normal (3DGS as MCMC, Kheradmand et al. 2024; constants of gsplat). Numbers are
 * made from (splat, step, seed) alone by a hash (PCG4D, Jarzynski and Olano 2020) and Box and
 * Muller's transform, so that a run can be repeated and taken up again, whatever the number of lanes
 * that hash at a time.
 *
 * It reads the lines that splat_update.cl writes, but stands by itself: relocation comes between the
 * two, on the host, and it takes 0.6 to 2.4 % of a step's kernels where it is asked for at all
 * (docs/benchmarks/training.md). Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: means, scales[count, 3], quats[count, 4], opacities[count]. */

#include "include/portable.h"
#include "include/splat/splat_rows.h"
#include "include/logarithm.h"
#include "include/rotated.h"
#include "include/turn.h"

#define STEEPNESS 100.0f
#define FAINT 0.005f
#define SALT 0x9e3779b9u

typedef struct {
  lanes_whole x, y, z, w;
} whole4;

static whole4 mixed(whole4 v) {
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return v;
}

/* PCG4D of (i, step, seed, SALT). */
static whole4 scramble(lanes_whole i, uint step, uint seed) {
  whole4 v;
  v.x = i * 1664525u + 1013904223u;
  v.y = step * 1664525u + 1013904223u;
  v.z = seed * 1664525u + 1013904223u;
  v.w = SALT * 1664525u + 1013904223u;
  v = mixed(v);
  v.x ^= v.x >> 16;
  v.y ^= v.y >> 16;
  v.z ^= v.z >> 16;
  v.w ^= v.w >> 16;
  return mixed(v);
}

/* In (0, 1), a half added to 24 bits. */
static lanes fraction(lanes_whole bits) {
  return (TO_FLOAT(WHOLE_TO_INT(bits >> 8)) + 0.5f) * (1.0f / 16777216.0f);
}

/* How far from the middle, of a share that lies farther. */
static lanes radius_of(lanes share) { return root_of(-2 * natural_log(share)); }

static lanes3 normal3(whole4 bits) {
  const lanes near = radius_of(fraction(bits.x)), far = radius_of(fraction(bits.z));
  const lanes turn = within_a_turn(fraction(bits.y)), other = within_a_turn(fraction(bits.w));
  return lanes3_of(near * cosine_of_turn(turn), near * sine_of_turn(turn), far * cosine_of_turn(other));
}

/* 1 / (1 + e^x) */
static lanes gate_of(lanes x) {
  const lanes e = power_of_two(-1.44269504f * absolute(x));
  return (x > 0 ? e : 1) / (1 + e);
}

KERNEL void splat_noise(
    __global float *restrict means, __global const float *restrict quats,
    __global const float *restrict scales, __global const float *restrict opacities,
    float amount, uint seed, uint step, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    lanes q[4];
    read_columns(quats, 4, 0, 4, rows, q);
    const lanes3 s = read3(scales, 3, rows), mean = read3(means, 3, rows);
    const lanes gate = gate_of(STEEPNESS * (read_numbers(opacities, rows) - FAINT));
    const lanes square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const lanes inverse = inverse_root(square), w = q[0] * inverse;
    const lanes3 v = lanes3_of(q[1] * inverse, q[2] * inverse, q[3] * inverse);
    const lanes_int i = (int)first + TO_INT(LANE_NUMBERS);
    const lanes3 xi = normal3(scramble(INT_TO_WHOLE(i), step, seed));
    /* Sigma xi = R S^2 R^T xi. */
    const lanes3 back = rotated(xi, -w, v);
    const lanes3 grown = lanes3_of(back.x * s.x * s.x, back.y * s.y * s.y, back.z * s.z * s.z);
    const lanes3 move = times(amount * gate, rotated(grown, w, v));
    write3(means, 3, rows, plus(mean, where((square > LEAST_SQUARE) & (square < MOST_SQUARE), move)));
  }
}
