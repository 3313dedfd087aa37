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
 * In place:
 * gradients come in by what is drawn and go out by what is trained. Index space: splats. */

#include "include/portable.h"
#include "include/activation.h"

KERNEL void splat_activate_grad(
    __global const float *restrict log_scales, __global const float *restrict logits,
    __global const float *restrict band, __global float *restrict by_scales,
    __global float *restrict by_opacities, float each_scale, float each_opacity, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  const Activation a = activated(log_scales, logits, band, i);
  const float by_opacity = by_opacities[i];
  for (int k = 0; k < 3; k++) {
    const float s = a.trained[k];
    float by = s * (s / a.drawn[k] * by_scales[3 * i + k] + each_scale);
#if BAND
    const float b = band[i] / a.drawn[k];
    by += a.opacity * a.faded * b * b * by_opacity;
#endif
    by_scales[3 * i + k] = by;
  }
#if AMPLITUDE
  const float hidden = 1 / (1 + exp(-logits[i]));
  by_opacities[i] = hidden * (a.faded * by_opacity + (1 - hidden) * each_opacity);
#else
  const float slope = DENSITY ? a.opacity : a.opacity * (1 - a.opacity);
  by_opacities[i] = slope * (a.faded * by_opacity + each_opacity);
#endif
}
