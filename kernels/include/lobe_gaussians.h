/* Sums of spherical Gaussians: MODES lobes, each with its own geometry.
 *
 *   isotropic    exp(-s |d - a|^2 / 2), which is exp(s (d . a - 1)) on the sphere without the
 *                cancellation; axis of any length, then ln s;
 *   anisotropic  max(d . a, 0) exp(-l1 (d . t)^2 - l2 (d . b)^2); quaternion, then ln l1, ln l2.
 *
 * Logarithms are held between +-MOST_LOG_SHARPNESS, sharpness between 1e-4 and 1e4, and have no
 * gradient beyond. */

#define MOST_LOG_SHARPNESS 9.2103403719761836f

static float sharpness(float ln) { return power_of_e(held(ln, -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS)); }

static float sharpness_is_free(float ln) { return is_free(ln, -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS); }

#if LOBES == SG

#define NUMBERS 4

typedef struct {
  float3 a, away; /* the axis, and d - a */
  float inverse;  /* of the axis' length as given */
  float s, parts, value;
} Lobe;

static int read_lobe(Lobe *l, __global const float *lobe, float3 d) {
  const float3 axis = load3(lobe, 0);
  const float largest = largest3(axis);
  if (!(largest > LEAST_LENGTH)) return 0;
  const float even = 1 / largest;
  const float3 u = axis * even;
  const float inverse = 1 / sqrt(dot3(u, u));
  l->a = u * inverse;
  l->inverse = inverse * even;
  l->away = d - l->a;
  l->s = sharpness(lobe[3]);
  l->parts = 0.5f * l->s * dot3(l->away, l->away);
  l->value = power_of_e(-l->parts);
  return 1;
}

/* The gradient of one lobe's geometry; gives dL/dd. */
static float3 lobe_grad(const Lobe *l, __global const float *lobe, float3 d, float by_value, __global float *grad) {
  const float by = by_value * l->value, steep = by * l->s;
  const float3 across = l->away - dot3(l->away, l->a) * l->a;
  store3(grad, 0, steep * l->inverse * across);
  grad[3] = -by * l->parts * sharpness_is_free(lobe[3]);
  return -steep * l->away;
}

#elif LOBES == ASG

#define NUMBERS 6

typedef struct {
  Frame frame;
  float3 place; /* d in the frame */
  float2 l, parts;
  float bell, value;
} Lobe;

static int read_lobe(Lobe *l, __global const float *lobe, float3 d) {
  if (!read_frame(&l->frame, lobe)) return 0;
  l->place = (float3)(dot3(d, l->frame.t), dot3(d, l->frame.b), dot3(d, l->frame.a));
  l->l = (float2)(sharpness(lobe[4]), sharpness(lobe[5]));
  l->parts = l->l * l->place.xy * l->place.xy;
  l->bell = power_of_e(-(l->parts.x + l->parts.y));
  l->value = l->place.z > 0 ? l->place.z * l->bell : 0;
  return 1;
}

/* The gradient of one lobe's geometry; gives dL/dd. */
static float3 lobe_grad(const Lobe *l, __global const float *lobe, float3 d, float by_value, __global float *grad) {
  const float by = by_value * l->value, up = l->place.z > 0 ? by_value * l->bell : 0;
  const float2 down = -2 * by * l->l * l->place.xy;
  const float3 g = down.x * l->frame.t + down.y * l->frame.b + up * l->frame.a;
  store_frame_grad(&l->frame, g, d, grad);
  grad[4] = -by * l->parts.x * sharpness_is_free(lobe[4]);
  grad[5] = -by * l->parts.y * sharpness_is_free(lobe[5]);
  return g;
}

#endif

#define GEOMETRY (NUMBERS * MODES)

/* All functions after the constant; 0 if the geometry has no meaning. */
static int lobe_functions(__global const float *lobe, float3 d, float *value) {
  Lobe l;
  if (!all_finite(lobe, GEOMETRY)) return 0;
  for (int k = 0; k < MODES; k++) {
    if (!read_lobe(&l, lobe + NUMBERS * k, d)) return 0;
    value[k] = l.value;
  }
  return 1;
}

/* The same of a geometry that has a meaning, and dL/dgeometry from dL/d(functions); gives dL/dd,
 * before the direction's length is held at 1. */
static float3 lobe_functions_grad(
    __global const float *lobe, float3 d, const float *by_value, float *value, __global float *grad)
{
  Lobe l;
  float3 g = 0;
  for (int k = 0; k < MODES; k++) {
    read_lobe(&l, lobe + NUMBERS * k, d);
    value[k] = l.value;
    g += lobe_grad(&l, lobe + NUMBERS * k, d, by_value[k], grad + NUMBERS * k);
  }
  return g;
}
