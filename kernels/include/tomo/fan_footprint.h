/* What a pixel leaves in the bins of a fan: weights that both halves of the pair evaluate alike.
 *
 * Pixels stand at whole numbers of lines a and slabs b (x and y, or y and x, whichever axis the view
 * looks along). A ray crosses slab b at the line
 *
 *     a(b) = start + s q,   s = b - (slabs - 1) / 2,
 *
 * and q lines on by the next slab. Ray and slab have their weight in common, rho = 1 / (1 + s inv),
 * the depth of the grid's middle over that of the slab, and rho^POWER.
 *
 * FOOTPRINT 0, strip: the rays are the edges between bins. The ray through a slab is aslant by
 * c = |q| lines; the part of pixel i that lies before it is ramp(z) - ramp(z - 1), where
 * z = start + s q - i and `start` has c / 2 + 1 / 2 added to it, and
 *
 *     ramp(z) = z^2 / (2 c) for 0 < z < c,   z - c / 2 beyond,   0 before.
 *
 * A bin's share of the pixel is the difference between its two edges, exactly the area of the
 * pixel between them. With u and l what z and z - 1 are when clamped to 0 .. c, the part before an
 * edge is (u - l) (u + l) / (2 c), and z - c clamped to 0 .. 1 added to it: that is 0 and 1 to the
 * bit beside the pixel, which fan_backproject.cl needs for rays that are not in reach.
 *
 * FOOTPRINT 1, joseph, and 2, linear: the rays are those of the bins' centres, and pixel i counts by
 * the hat max(0, 1 - |a - i| / h) / h; h is one line, or for `linear` the bin's width in lines if
 * that is more.
 *
 * Rays come in the order of their lines; where bins run the other way they are counted from behind. */

#ifndef FOOTPRINT
#define FOOTPRINT 0
#endif
#ifndef POWER
#define POWER 1
#endif

/* A view's numbers, 16 to a view, in this order. */
#define VIEW_NUMBERS 16
#define INVERSE_DEPTH 0
#define MIDDLE_SLOPE 1
#define FIRST_RAY 2
#define ARC 3
#define ACROSS 4 /* three: middle, by a line, by a slab */
#define AHEAD 7  /* two: by a line, by a slab; the middle is one */
#define WIDEST 9 /* half of what a pixel reaches in lines, over 1 + c; of hats the widest bin */
#define ALONG_Y 10
#define MIRRORED 11
#define RAYS 12 /* most that a pixel of the middle slab spans; fewer the deeper */
#define LEAST_RAYS 13 /* that it spans however deep */
#define MOST_RAYS 14 /* that any pixel of the grid reaches */
#define FIRST_SEEN 15 /* ray that any pixel reaches, where wide hats reach for narrow bins too */

/* Slants below this are one: the ramp is then a step to within float32. */
#define STEEPEST 1e-6f

static lanes slant_of(lanes q) {
  const lanes c = q > -q ? q : -q;
  return c > STEEPEST ? c : STEEPEST;
}

static lanes clamped(lanes z, lanes high) {
  const lanes above = z > 0 ? z : 0;
  return above < high ? above : high;
}

/* The part of a pixel before an edge, given z - c, and u and l. */
static lanes part_before(lanes beyond, lanes u, lanes l, lanes half_inverse) {
  return (u - l) * (u + l) * half_inverse + clamped(beyond, (lanes)1.0f);
}

static lanes hat(lanes distance, lanes inverse) {
  const lanes rest = 1.0f - absolute(distance) * inverse;
  return rest > 0 ? rest * inverse : 0;
}

/* rho^POWER; a strip's width in lines grows with the depth as well. */
#if FOOTPRINT == 0
#define SLAB_WEIGHT(rho) (POWER == 2 ? (rho) * (rho) : (rho))
#else
#define SLAB_WEIGHT(rho) (POWER == 2 ? (rho) : 1.0f)
#endif
