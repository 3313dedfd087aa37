/* What a pixel leaves on the detector: its share of a bin as a function of their distance in bins.
 *
 * Every footprint is even and ends at `support`. Its numbers come with the view, a real8:
 * (support, scale, and what the profile needs); the profile times scale is the bin's weight.
 *
 * STRIP 0, a hat: 1 - |d| / h; s2 = 1 / h. It is linear interpolation between bins where h is 1,
 * and between pixels (Joseph 1982) where h is the pixel's step over the detector.
 *
 * STRIP 1, the area that a pixel and a bin's strip share. A square's shadow is a trapezoid, two
 * boxes convolved; the bin is a third one. Let L be the longest of the three and c the integral of
 * the trapezoid of the two others, from 0 to 1; then c(d + L/2) - c(d - L/2) is the share times L.
 * With the longest taken out the difference is of the order of one, and has the rounding of one.
 * The trapezoid's outer half-width is s3, its ramps are s4 wide and it is 1 / s6 high; s2 = L/2,
 * s5 = 1 / (2 s4), or any number where s4 is zero. */

#ifndef STRIP
#define STRIP 0
#endif
#define SUPPORT s0
#define SCALE s1

static lanes positive(lanes v) { return v > 0 ? v : 0; }

#if STRIP
/* The trapezoid's area up to `inside` from its outer end, which is not beyond the middle. */
static lanes area_of_end(lanes inside, real8 f) {
  const lanes ramp = inside < f.s4 ? inside : f.s4;
  return (ramp * (ramp * f.s5) + (inside - ramp)) * f.s6;
}

static lanes footprint(lanes distance, real8 f) {
  const lanes r = absolute(distance), near = f.s2 - r;
  const lanes end = area_of_end(positive(f.s3 - absolute(near)), f);
  return (near > 0 ? 1.0f - end : end) - area_of_end(positive(f.s3 - f.s2 - r), f);
}
#else
static lanes footprint(lanes distance, real8 f) {
  return positive(1.0f - absolute(distance) * f.s2);
}
#endif
