/* Light from far away that all splats share, as a splat with a normal reflects it.
 *
 * The light is a sum of lobes exp(g (a_k . x - 1)) of one sharpness g about fixed axes a_k, with a
 * radiance A_k each. A rough surface sees it blurred: its own lobe of sharpness kappa about the
 * mirrored direction makes of both
 *
 *     L(r) = w sum over k of A_k exp(s (a_k . r - 1)),    s = g kappa / (g + kappa),  w = s / g,
 *     r = d - 2 (d . n) n,
 *
 * since variances add; w keeps each lobe's integral. What is reflected is (tint + grazing (1 -
 * |d . n|)^5) L, channel by channel, as Schlick has it. Reversing the normal changes nothing.
 *
 * A splat's reflectance is 7 numbers: logits of tint and of grazing tint, three each, and ln kappa,
 * held between +-MOST_LOG_KAPPA without a gradient beyond. A splat whose normal has no direction, or
 * whose numbers are none, reflects nothing.
 *
 * A lobe of the light is a row of LIGHT_ROW numbers: a_k, nothing, A_k, nothing. */

#include "include/shading/seen_color.h"
#include "include/shading/lobe_frame.h"

#define REFLECTANCE 7
#define LIGHT_ROW 8
#define MOST_LOG_KAPPA 9.2103403719761836f
#define LOG2_OF_E 1.44269504f

typedef struct {
  lanes3 normal;        /* of length one */
  lanes inverse;        /* of the normal's length as given */
  lanes facing;         /* d . n */
  lanes3 mirrored;      /* r */
  lanes kappa, s, w;
  lanes edge, rim;      /* 1 - |d . n|, and its fifth power */
  lanes3 tint, grazing; /* between 0 and 1 */
} Reflection;

static lanes logistic(lanes x) { return 1 / (1 + power_of_e(-x)); }

static lanes3 each_times(lanes3 a, lanes3 b) { return lanes3_of(a.x * b.x, a.y * b.y, a.z * b.z); }

/* Reads how splats reflect what comes along d; where that has no meaning, it is false. */
static lanes_int read_reflection(
    Reflection *m, __global const float *normals, const lanes *reflectance, Rows rows, lanes3 d,
    float lattice)
{
  const lanes3 given = read3(normals, 3, rows);
  const lanes largest = largest_of(given), even = 1 / largest;
  const lanes3 u = times(even, given);
  const lanes inverse = inverse_root(dot_of(u, u));
  m->normal = times(inverse, u);
  m->inverse = inverse * even;
  m->facing = dot_of(d, m->normal);
  m->mirrored = minus(d, times(2 * m->facing, m->normal));
  m->kappa = power_of_e(held(reflectance[6], -MOST_LOG_KAPPA, MOST_LOG_KAPPA));
  m->w = m->kappa / (lattice + m->kappa);
  m->s = lattice * m->w;
  m->edge = larger(1 - absolute(m->facing), 0);
  m->rim = m->edge * m->edge * m->edge * m->edge * m->edge;
  m->tint = lanes3_of(logistic(reflectance[0]), logistic(reflectance[1]), logistic(reflectance[2]));
  m->grazing = lanes3_of(logistic(reflectance[3]), logistic(reflectance[4]), logistic(reflectance[5]));
  return (largest > LEAST_LENGTH) & !no_numbers(given) & all_finite(reflectance, REFLECTANCE);
}

/* What part of the light is reflected. */
static lanes3 tint_of(const Reflection *m) { return plus(m->tint, times(m->rim, m->grazing)); }
