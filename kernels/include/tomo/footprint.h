/* What a pixel leaves on the detector: its share of a bin as a function of their distance in bins.
 *
 * Every footprint is even and ends at `support`. Its numbers come with the view, in a view_shape:
 * (support, scale, and what the profile needs); the profile times scale is the bin's weight.
 *
 * STRIP 0, a hat: 1 - |d| / h; s2 = 1 / h. It is linear interpolation between bins where h is 1,
 * and between pixels (Joseph 1982) where h is the pixel's step over the detector.
 *
 * STRIP 1, the area that a pixel and a bin's strip share, for shadows that cover many bins
 * (shadow.h has others for less). A square's shadow is a trapezoid, two boxes convolved; the bin is
 * a third one. Let S <= M <= L be the three widths and c the integral of the trapezoid of S and M,
 * from 0 to M; then c(d + L/2) - c(d - L/2) is the share times L M. With the longest taken out the
 * difference is of the order of M, and has its rounding. Both integrals are taken from their ends:
 * the trapezoid's outer half-width is s3 = (S + M) / 2, its ramps are s4 = S wide, s5 = 1 / (2 S),
 * or any number where S is zero, s2 = L/2 and s7 = M. Of the first, what is missing from M is never
 * more than half of a ramp, s6 = (S + M - L) / 2 long or none. */

#ifndef STRIP
#define STRIP 0
#endif
#define SUPPORT s0
#define SCALE s1

static lanes positive(lanes v) { return v > 0 ? v : 0; }

#if STRIP
static lanes footprint(lanes distance, view_shape f) {
  const lanes r = absolute(distance), near = f.s2 - r;
  const lanes inside = positive(f.s3 - absolute(near)), ramp = inside < f.s4 ? inside : f.s4;
  const lanes end = ramp * (ramp * f.s5) + (inside - ramp), top = positive(f.s6 - r);
  return (near > 0 ? f.s7 - end : end) - top * (top * f.s5);
}
#else
static lanes footprint(lanes distance, view_shape f) {
  return positive(1.0f - absolute(distance) * f.s2);
}
#endif
