/* What the aperture of a thin lens adds to a splat's variance on the screen, and the gradient.
 *
 * The aperture has the radius R and is sharp at the depth F. A point at depth z becomes a disc of
 * diameter 2 R f |1/z - 1/F| in pixels, f^2 = fx fy, with the variance diameter^2 / 16 along each
 * axis. Diffraction adds that of the Gaussian with the Airy pattern's light and peak (its own is
 * infinite): (L f)^2, L = wavelength / (sqrt(2) pi R). */

#if DEFOCUS

static Camera with_aperture(Camera c, float4 aperture) {
  c.radius = aperture.x;
  c.inverse_focus = aperture.y;
  c.diffraction = aperture.z;
  return c;
}

/* What the aperture adds to a splat's variance at depth z, in square pixels. */
static lanes blur_variance(Camera c, lanes z) {
  const lanes away = c.radius * (1 / z - c.inverse_focus);
  return c.fx * c.fy * (0.25f * away * away + c.diffraction * c.diffraction);
}

/* Adds to a gradient what comes in by that variance; 1/F is smooth where F is infinite. */
static void add_blur_grad(Camera c, lanes z, lanes by_variance, CameraGradient *out) {
  const lanes inverse = 1 / z, away = c.radius * (inverse - c.inverse_focus);
  const float airy = c.diffraction * c.diffraction;
  const lanes disc = 0.25f * away * away;
  const lanes by_share = by_variance * c.fx * c.fy, slope = 0.5f * by_share * away * c.radius;
  out->point.z -= slope * inverse * inverse;
  out->fx += by_variance * c.fy * (disc + airy);
  out->fy += by_variance * c.fx * (disc + airy);
  out->radius = by_share * 2 * (disc - airy) / c.radius;
  out->focus = slope * c.inverse_focus * c.inverse_focus;
}

#endif
