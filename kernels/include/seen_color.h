/* Colours by the direction that a splat is seen in: what harmonics and lobes share.
 *
 * The direction is mean - camera, unit; (0, 0, 1) where the camera stands in the mean. Of the sum
 * of functions a colour is what is above zero, and black where it is not finite. On the way back a
 * colour that was held at zero passes nothing on. Only the direction's change across itself
 * counts, so that a gradient g by it gives dL/dmean = (g - (g . d) d) / distance. The camera stands
 * at o = -W^-1 t, so with dL/do = -dL/dmean its parts gain
 *
 *     dL/dt = W^-T dL/dmean,      dL/dW = (W^-T dL/dmean) o^T.
 *
 * Tables of features have STRIDE numbers for each splat, of which the first three are the colour.
 * Needs small_matrix.h. */

#ifndef STRIDE
#define STRIDE 3
#endif
#ifndef CAMERA_GRADIENT
#define CAMERA_GRADIENT 1
#endif

static float3 direction_of(float3 away) {
  const float square = dot3(away, away);
  return square > 0 ? away / sqrt(square) : (float3)(0, 0, 1);
}

static float3 color_of(float3 sum) {
  return not_finite3(sum) ? (float3)(0, 0, 0) : sum > 0 ? sum : (float3)(0, 0, 0);
}

static int is_black(float3 color) { return !(color.x > 0) && !(color.y > 0) && !(color.z > 0); }

/* What comes in of a colour's gradient. */
static float3 incoming_of(float3 color, __global const float *grad) {
  return (float3)(color.x > 0 ? grad[0] : 0, color.y > 0 ? grad[1] : 0, color.z > 0 ? grad[2] : 0);
}

/* The direction on the way back, with one over the distance, and where the camera stands. */
typedef struct {
  float3 center, direction;
  float inverse;
} Sight;

static Sight sight_of(float3 mean, float3 center) {
  const float3 away = mean - center;
  const float square = dot3(away, away);
  Sight s;
  s.center = center;
  s.inverse = square > 0 ? 1 / sqrt(square) : 0;
  s.direction = square > 0 ? away * s.inverse : (float3)(0, 0, 1);
  return s;
}

static void add3(__global float *p, long i, float3 v) { store3(p, i, load3(p, i) + v); }

/* Add the gradient g by the direction to those of splat i's mean and of the camera; x, y, z are the
 * rows of W^-T. */
static void add_by_direction(
    float3 g, Sight s, float3 x, float3 y, float3 z, long i, __global float *grad_means,
    __global float *camera_parts)
{
  const float3 by_mean = (g - dot3(g, s.direction) * s.direction) * s.inverse;
  add3(grad_means, i, by_mean);
#if CAMERA_GRADIENT
  __global float *part = camera_parts + 16 * i;
  const float3 shift = (float3)(dot3(x, by_mean), dot3(y, by_mean), dot3(z, by_mean));
  add3(part, 0, shift.x * s.center);
  add3(part + 4, 0, shift.y * s.center);
  add3(part + 8, 0, shift.z * s.center);
  part[3] += shift.x;
  part[7] += shift.y;
  part[11] += shift.z;
#endif
}
