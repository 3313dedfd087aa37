/* The alpha that accumulated depth is divided by: nothing drawn must not divide by zero. */

#define LEAST_ALPHA 1e-10f

static float held_alpha(float transmittance) {
  const float alpha = 1 - transmittance;
  return alpha > LEAST_ALPHA ? alpha : LEAST_ALPHA;
}
