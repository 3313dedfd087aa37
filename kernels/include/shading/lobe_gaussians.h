/* Sums of spherical Gaussians: MODES lobes, each with its own geometry.
 *
 *   isotropic    exp(-s |d - a|^2 / 2), which is exp(s (d . a - 1)) on the sphere without the
 *                cancellation; axis of any length, then ln s;
 *   anisotropic  max(d . a, 0) exp(-l1 (d . t)^2 - l2 (d . b)^2); quaternion, then ln l1, ln l2.
 *
 * Logarithms are held between +-MOST_LOG_SHARPNESS, sharpness between 1e-4 and 1e4, and have no
 * gradient beyond. */

#define MOST_LOG_SHARPNESS 9.2103403719761836f

static lanes sharpness(lanes ln) { return power_of_e(held(ln, -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS)); }

static lanes if_sharpness_is_free(lanes ln, lanes slope) {
  return if_free(ln, -MOST_LOG_SHARPNESS, MOST_LOG_SHARPNESS, slope);
}

#if LOBES == SG

#define NUMBERS 4

typedef struct {
  lanes3 a, away; /* the axis, and d - a */
  lanes inverse;  /* of the axis' length as given */
  lanes s, parts, value;
} Lobe;

static lanes_int read_lobe(Lobe *l, const lanes *lobe, lanes3 d) {
  const lanes3 axis = lanes3_of(lobe[0], lobe[1], lobe[2]);
  const lanes largest = largest_of(axis), even = 1 / largest;
  const lanes3 u = times(even, axis);
  const lanes inverse = inverse_root(dot_of(u, u));
  l->a = times(inverse, u);
  l->inverse = inverse * even;
  l->away = minus(d, l->a);
  l->s = sharpness(lobe[3]);
  l->parts = 0.5f * l->s * dot_of(l->away, l->away);
  l->value = power_of_e(-l->parts);
  return largest > LEAST_LENGTH;
}

/* The gradient of one lobe's geometry; gives dL/dd. */
static lanes3 lobe_grad(const Lobe *l, const lanes *lobe, lanes3 d, lanes by_value, lanes *grad) {
  const lanes by = by_value * l->value, steep = by * l->s;
  const lanes3 across = minus(l->away, times(dot_of(l->away, l->a), l->a));
  const lanes share = steep * l->inverse;
  grad[0] = share * across.x;
  grad[1] = share * across.y;
  grad[2] = share * across.z;
  grad[3] = if_sharpness_is_free(lobe[3], -by * l->parts);
  return times(-steep, l->away);
}

#elif LOBES == ASG

#define NUMBERS 6

typedef struct {
  Frame frame;
  lanes3 place; /* d in the frame */
  lanes l1, l2, part1, part2, bell, value;
} Lobe;

static lanes_int read_lobe(Lobe *l, const lanes *lobe, lanes3 d) {
  const lanes_int has_frame = read_frame(&l->frame, lobe);
  l->place = lanes3_of(dot_of(d, l->frame.t), dot_of(d, l->frame.b), dot_of(d, l->frame.a));
  l->l1 = sharpness(lobe[4]);
  l->l2 = sharpness(lobe[5]);
  l->part1 = l->l1 * l->place.x * l->place.x;
  l->part2 = l->l2 * l->place.y * l->place.y;
  l->bell = power_of_e(-(l->part1 + l->part2));
  l->value = l->place.z > 0 ? l->place.z * l->bell : 0;
  return has_frame;
}

/* The gradient of one lobe's geometry; gives dL/dd. */
static lanes3 lobe_grad(const Lobe *l, const lanes *lobe, lanes3 d, lanes by_value, lanes *grad) {
  const lanes by = by_value * l->value, up = l->place.z > 0 ? by_value * l->bell : 0;
  const lanes down1 = -2 * by * l->l1 * l->place.x, down2 = -2 * by * l->l2 * l->place.y;
  const lanes3 flat = plus(times(down1, l->frame.t), times(down2, l->frame.b));
  const lanes3 g = plus(flat, times(up, l->frame.a));
  frame_grad(&l->frame, g, d, grad);
  grad[4] = if_sharpness_is_free(lobe[4], -by * l->part1);
  grad[5] = if_sharpness_is_free(lobe[5], -by * l->part2);
  return g;
}

#endif

#define GEOMETRY (NUMBERS * MODES)

/* All functions after the constant; false where the geometry has no meaning. */
static lanes_int lobe_functions(const lanes *lobe, lanes3 d, lanes *value) {
  Lobe l;
  lanes_int meant = all_finite(lobe, GEOMETRY);
  for (int k = 0; k < MODES; k++) {
    meant &= read_lobe(&l, lobe + NUMBERS * k, d);
    value[k] = l.value;
  }
  return meant;
}

/* The same of a geometry that has a meaning, and dL/dgeometry from dL/d(functions); gives dL/dd,
 * before the direction's length is held at 1. */
static lanes3 lobe_functions_grad(
    const lanes *lobe, lanes3 d, const lanes *by_value, lanes *value, lanes *grad)
{
  Lobe l;
  lanes3 g = lanes3_of(0, 0, 0);
  for (int k = 0; k < MODES; k++) {
    read_lobe(&l, lobe + NUMBERS * k, d);
    value[k] = l.value;
    g = plus(g, lobe_grad(&l, lobe + NUMBERS * k, d, by_value[k], grad + NUMBERS * k));
  }
  return g;
}
