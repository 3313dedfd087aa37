/* A step of Adam along splats' places, turns, scales and opacities, and what is drawn of them after it.
 *
 * Gradients come in by what is drawn. Scales and opacities are trained before their activation
 * (splat_activate.cl): with s, o what is trained, s', o' what is drawn, f = prod s / s' and b the limit
 * of the band,
 *
 *     dL/dlog_scale = s (s / s' dL/ds' + each_scale + [s is the smallest] each_flat)
 *                     + o f b^2 / s'^2 dL/do',
 *     dL/dlogit = slope (f dL/do' + each_opacity - each_entropy logit),
 *
 * where slope is o (1 - o), or o for densities, and each_.. are penalties of the loss over what their
 * means are taken over: of mean(o) and mean(s) (3DGS as MCMC, Kheradmand et al. 2024), of the mean
 * over splats of the smallest s, and of the mean of -o ln o - (1 - o) ln(1 - o). Where o is an optical
 * depth it has no bound, and the penalties are of what it hides, p = sigmoid(logit):
 *
 *     dL/dlogit = p f dL/do' + p (1 - p) (each_opacity - each_entropy logit).
 *
 * With SHEET turns have a penalty as well, of the mean of 1 - (n . a)^2, n the normal of the sheet that
 * a splat lies in and a the axis of its smallest scale. A turn by w moves a by w x a, and q by
 * (0, w) q / 2, so that with t = each_turn (n . a) (n x a), each_turn twice the penalty over N,
 *
 *     dL/dq = 2 (0, t) q / |q|^2.
 *
 * All of it is one pass over a splat's lines of memory, in place. _m and _v are Adam's moments, rates
 * those of means, quats, log_scales and logits; `shares` are ones. Index space: (runs of RUN splats),
 * LANES of them at a time.
 *
 * Buffers: means, means_m, means_v, by_means, log_scales, log_scales_m, log_scales_v, by_scales,
 * scales[count, 3], quats, quats_m, quats_v, by_quats[count, 4], logits, logits_m, logits_v, by_opacities,
 * opacities[count], band[BAND ? count : 0], sheet[SHEET ? count : 0, 3], shares[LANES]. */

#include "include/portable.h"
#include "include/rotated.h"
#include "include/splat/activation.h"
#include "include/train/adam_step.h"

#ifndef SHEET
#define SHEET 0
#endif

/* Ones at the smallest of a splat's scales: at one of them alone, where two are equal. */
static lanes3 smallest(lanes3 s) {
  const lanes_int x = (s.x <= s.y) & (s.x <= s.z), y = (s.y <= s.z);
  return lanes3_of(x ? (lanes)1 : (lanes)0, x ? (lanes)0 : y ? (lanes)1 : (lanes)0, (x | y) ? (lanes)0 : (lanes)1);
}

/* dL/dlog_scale of one of the three. */
static lanes log_scale_grad(lanes trained, lanes drawn, lanes by_scale, lanes each_scale,
    lanes fading, lanes band) {
  const lanes by = trained * (trained / drawn * by_scale + each_scale);
#if BAND
  const lanes b = band / drawn;
  return by + fading * b * b;
#else
  return by;
#endif
}

/* dL/dlog_scales and dL/dlogits of LANES splats. */
static lanes3 trained_grad(
    Activation a, lanes logit, lanes3 by, lanes by_opacity, lanes band, float each_scale, float each_flat,
    float each_opacity, float each_entropy, lanes *by_logit)
{
  const lanes fading = a.opacity * a.faded * by_opacity;
  const lanes3 s = a.trained, d = a.drawn, flat = times(each_flat, smallest(s));
  const lanes hides = each_opacity - each_entropy * logit;
#if AMPLITUDE
  const lanes hidden = sigmoid(logit);
  *by_logit = hidden * (a.faded * by_opacity + (1 - hidden) * hides);
#else
  const lanes slope = DENSITY ? a.opacity : a.opacity * (1 - a.opacity);
  *by_logit = slope * (a.faded * by_opacity + hides);
#endif
  return lanes3_of(
      log_scale_grad(s.x, d.x, by.x, each_scale + flat.x, fading, band),
      log_scale_grad(s.y, d.y, by.y, each_scale + flat.y, fading, band),
      log_scale_grad(s.z, d.z, by.z, each_scale + flat.z, fading, band));
}

#if SHEET

/* dL/dq of the penalty on turns; nothing for quaternions that are none. */
static void turn_grad(lanes3 scales, lanes3 normal, float each_turn, const lanes *q, lanes *by) {
  const lanes square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  const lanes_int meant = (square > LEAST_SQUARE) & (square < MOST_SQUARE);
  const lanes inverse = meant ? inverse_root(square) : 0, w = q[0] * inverse;
  const lanes3 v = times(inverse, lanes3_of(q[1], q[2], q[3]));
  const lanes3 axis = rotated(smallest(scales), w, v);
  const lanes3 turn = times(each_turn * dot_of(normal, axis), cross_of(normal, axis));
  const lanes3 along = plus(times(w, turn), cross_of(turn, v));
  const lanes share = 2 * inverse;
  by[0] = -share * dot_of(turn, v);
  by[1] = share * along.x;
  by[2] = share * along.y;
  by[3] = share * along.z;
}

#endif

KERNEL void splat_update(
    __global float *restrict means, __global float *restrict means_m, __global float *restrict means_v,
    __global float *restrict quats, __global float *restrict quats_m, __global float *restrict quats_v,
    __global float *restrict log_scales, __global float *restrict log_scales_m,
    __global float *restrict log_scales_v, __global float *restrict logits,
    __global float *restrict logits_m, __global float *restrict logits_v,
    __global const float *restrict by_means, __global const float *restrict by_quats,
    __global const float *restrict by_scales, __global const float *restrict by_opacities,
    __global const float *restrict band, __global const float *restrict sheet,
    __global float *restrict scales, __global float *restrict opacities,
    __global const float *restrict shares, float each_scale, float each_flat, float each_opacity,
    float each_entropy, float each_turn, float4 rates, float beta1, float beta2, float c1, float c2,
    float epsilon, int count)
{
  const Adam of_means = {means_m, means_v, shares, 1, rates.x, beta1, beta2, c1, c2, epsilon};
  const Adam of_quats = {quats_m, quats_v, shares, 1, rates.y, beta1, beta2, c1, c2, epsilon};
  const Adam of_scales = {log_scales_m, log_scales_v, shares, 1, rates.z, beta1, beta2, c1, c2, epsilon};
  const Adam of_logits = {logits_m, logits_v, shares, 1, rates.w, beta1, beta2, c1, c2, epsilon};
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const ulong from = (ulong)first, to = from + (LANES == 1 ? 1 : rows.count);
    const lanes logit = read_numbers(logits, rows), limit = BAND ? read_numbers(band, rows) : 0;
    const Activation before = activated(log_scales, logit, band, rows);
    lanes by_logit, columns[3], by_logs[3];
    const lanes3 by = trained_grad(
        before, logit, read3(by_scales, 3, rows), read_numbers(by_opacities, rows), limit, each_scale,
        each_flat, each_opacity, each_entropy, &by_logit);
    columns[0] = by.x;
    columns[1] = by.y;
    columns[2] = by.z;
    keep_columns(by_logs, 3, 0, 3, columns);
    adam_between(means, of_means, 3 * from, 3 * to, by_means);
#if SHEET
    lanes q[4], turns[4], by_turns[4];
    read_columns(quats, 4, 0, 4, rows, q);
    read_columns(by_quats, 4, 0, 4, rows, turns);
    lanes penalty[4];
    turn_grad(before.trained, read3(sheet, 3, rows), each_turn, q, penalty);
    UNROLL for (int k = 0; k < 4; k++) turns[k] += penalty[k];
    keep_columns(by_turns, 4, 0, 4, turns);
    adam_along(quats, of_quats, 4 * from, (int)(4 * (to - from)), by_turns);
#else
    adam_between(quats, of_quats, 4 * from, 4 * to, by_quats);
#endif
    adam_along(log_scales, of_scales, 3 * from, (int)(3 * (to - from)), by_logs);
    adam_along(logits, of_logits, from, (int)(to - from), &by_logit);
    const Activation after = activated(log_scales, read_numbers(logits, rows), band, rows);
    write3(scales, 3, rows, after.drawn);
    write_numbers(opacities, rows, after.opacity * after.faded);
  }
}
