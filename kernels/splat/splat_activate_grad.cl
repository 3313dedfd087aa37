/* Gradient of splat_activate, with penalties that keep splats small and few.
 *
 * With s, o what is trained, s', o' what is drawn, f = prod s / s' and b the limit of the band,
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
 * In place: gradients come in by what is drawn and go out by what is trained. Index space: (runs of RUN
 * splats), LANES of them at a time. */

#include "include/portable.h"
#include "include/splat/activation.h"

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

KERNEL void splat_activate_grad(
    __global const float *restrict log_scales, __global const float *restrict logits,
    __global const float *restrict band, __global float *restrict by_scales,
    __global float *restrict by_opacities, float each_scale, float each_opacity, int count)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    const lanes logit = read_numbers(logits, rows), by_opacity = read_numbers(by_opacities, rows);
    const Activation a = activated(log_scales, logit, band, rows);
    const lanes b = BAND ? read_numbers(band, rows) : 0, fading = a.opacity * a.faded * by_opacity;
    const lanes3 by = read3(by_scales, 3, rows), s = a.trained, d = a.drawn;
    write3(by_scales, 3, rows, lanes3_of(
        log_scale_grad(s.x, d.x, by.x, each_scale, fading, b),
        log_scale_grad(s.y, d.y, by.y, each_scale, fading, b),
        log_scale_grad(s.z, d.z, by.z, each_scale, fading, b)));
#if AMPLITUDE
    const lanes hidden = sigmoid(logit);
    write_numbers(by_opacities, rows, hidden * (a.faded * by_opacity + (1 - hidden) * each_opacity));
#else
    const lanes slope = DENSITY ? a.opacity : a.opacity * (1 - a.opacity);
    write_numbers(by_opacities, rows, slope * (a.faded * by_opacity + each_opacity));
#endif
  }
}
