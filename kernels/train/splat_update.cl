/* A step of Adam along splats' places, turns, scales and opacities, and what is drawn of them after it.
 *
 * Gradients come in by what is drawn. Scales and opacities are trained before their activation
 * (splat_activate.cl): with s, o what is trained, s', o' what is drawn, f = prod s / s' and b the limit
 * of the band,
 *
 *     dL/dlog_scale = s (s / s' dL/ds' + scale_penalty / 3N) + o f b^2 / s'^2 dL/do',
 *     dL/dlogit = slope (f dL/do' + opacity_penalty / N),
 *
 * where slope is o (1 - o), or o for densities: the penalties are those of the loss
 * opacity_penalty mean(o) + scale_penalty mean(s) (3DGS as MCMC, Kheradmand et al. 2024). Where o is
 * an optical depth it has no bound, and the penalty is of what it hides, p = sigmoid(logit):
 *
 *     dL/dlogit = p f dL/do' + p (1 - p) opacity_penalty / N.
 *
 * All of it is one pass over a splat's lines of memory, in place. _m and _v are Adam's moments, rates
 * those of means, quats, log_scales and logits; `shares` are ones. Index space: (runs of RUN splats),
 * LANES of them at a time. */

#include "include/portable.h"
#include "include/splat/activation.h"
#include "include/train/adam_step.h"

/* dL/dlog_scale of one of the three. */
static lanes log_scale_grad(lanes trained, lanes drawn, lanes by_scale, float each_scale,
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
    Activation a, lanes logit, lanes3 by, lanes by_opacity, lanes band, float each_scale, float each_opacity,
    lanes *by_logit)
{
  const lanes fading = a.opacity * a.faded * by_opacity;
  const lanes3 s = a.trained, d = a.drawn;
#if AMPLITUDE
  const lanes hidden = sigmoid(logit);
  *by_logit = hidden * (a.faded * by_opacity + (1 - hidden) * each_opacity);
#else
  const lanes slope = DENSITY ? a.opacity : a.opacity * (1 - a.opacity);
  *by_logit = slope * (a.faded * by_opacity + each_opacity);
#endif
  return lanes3_of(
      log_scale_grad(s.x, d.x, by.x, each_scale, fading, band),
      log_scale_grad(s.y, d.y, by.y, each_scale, fading, band),
      log_scale_grad(s.z, d.z, by.z, each_scale, fading, band));
}

KERNEL void splat_update(
    __global float *restrict means, __global float *restrict means_m, __global float *restrict means_v,
    __global float *restrict quats, __global float *restrict quats_m, __global float *restrict quats_v,
    __global float *restrict log_scales, __global float *restrict log_scales_m,
    __global float *restrict log_scales_v, __global float *restrict logits,
    __global float *restrict logits_m, __global float *restrict logits_v,
    __global const float *restrict by_means, __global const float *restrict by_quats,
    __global const float *restrict by_scales, __global const float *restrict by_opacities,
    __global const float *restrict band, __global float *restrict scales,
    __global float *restrict opacities, __global const float *restrict shares, float each_scale,
    float each_opacity, float4 rates, float beta1, float beta2, float c1, float c2, float epsilon, int count)
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
        each_opacity, &by_logit);
    columns[0] = by.x;
    columns[1] = by.y;
    columns[2] = by.z;
    keep_columns(by_logs, 3, 0, 3, columns);
    adam_between(means, of_means, 3 * from, 3 * to, by_means);
    adam_between(quats, of_quats, 4 * from, 4 * to, by_quats);
    adam_along(log_scales, of_scales, 3 * from, (int)(3 * (to - from)), by_logs);
    adam_along(logits, of_logits, from, (int)(to - from), &by_logit);
    const Activation after = activated(log_scales, read_numbers(logits, rows), band, rows);
    write3(scales, 3, rows, after.drawn);
    write_numbers(opacities, rows, after.opacity * after.faded);
  }
}
