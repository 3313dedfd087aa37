/* A pixel's shadow on the detector, cut by the edge between two bins.
 *
 * A square's shadow is a trapezoid. Let S <= M be the shadows of its two sides, in bins: then the
 * trapezoid's half-width is (S + M) / 2, its ramps are S wide and it is 1 / M high. With x the
 * distance from an edge to the shadow's middle, M times the share of the shadow beyond the edge is
 *
 *     share(x) = M - end(x) for x > 0, end(-x) otherwise,
 *
 * end(x) being the trapezoid's area from x outwards, times M. It is exactly 0 or M where the shadow
 * lies to one side. A bin's share of the pixel, the strip footprint, is the difference of the
 * shares beyond its two edges; its rounding is that of M, which is why shadows many bins wide are
 * taken bin by bin (footprint.h).
 *
 * The numbers come with the view, in a view_shape: (half-width, scale, S, 1 / (2 S), M); where S is
 * zero its inverse may be any number. */

#define HALF_WIDTH s0
#define SCALE s1
#define WHOLE_SHARE s4

static lanes share(lanes x, view_shape shadow) {
  const lanes room = shadow.HALF_WIDTH - absolute(x), inside = room > 0 ? room : 0;
  const lanes ramp = inside < shadow.s2 ? inside : shadow.s2;
  const lanes end = ramp * (ramp * shadow.s3) + (inside - ramp);
  return x > 0 ? shadow.WHOLE_SHARE - end : end;
}

/* A view whose columns run down the detector is seen in a mirror, so that they run up it. */
static long4 run_upwards(long4 g, int bins) {
  const int down = g.w < 0;
  /* One by one: of a choice between two long4 clspv makes a vector of eight, which Vulkan has none of. */
  return (long4)(g.x, g.y, down ? ((long)(bins - 1) << 32) - g.z : g.z, down ? -g.w : g.w);
}

/* Where bin b of a view stands in memory, from the view's first number on. */
#define PLACE(b, mirrored, bins) ((mirrored) ? (bins) - 1 - (b) : (b))

/* Distances from the lower edge of bin b to the places of LANES phases, from `phase` on, of
 * column k. Both resampling kernels ask here, so that they weight alike to the bit. */
#define FROM_EDGE(g, k, phase, b) \
  (FIXED_TO_REAL((g).z + (k) * (g).w - ((long)(b) << 32) + (1L << 31)) + \
   ((real)(phase) + LANE_NUMBERS) * (FIXED_TO_REAL((g).w) * (1.0f / PHASES)))
