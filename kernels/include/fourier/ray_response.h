/* The factor between a view's transform and its ray of the image's spectrum.
 *
 * Sample l of `length` is l / length cycles per bin. The area that a pixel and a bin share, as the
 * bin moves along, has the spectrum of three boxes: the bin's sinc(l / length), which `bins` holds,
 * and sinc(l s / length) for the shadows s of the pixel's two edges, in bins (times their areas, which
 * the projector's scale takes away). That the image's middle is seen a fraction `turn` of 2^32 length
 * bins behind the first row turns sample l by l * turn. Rays run along the lanes; `along` and `up` are
 * s / (2 length) of the edges along x and along y. */

typedef struct { lanes real, imaginary; } response;

/* A ray's constants. */
typedef struct { lanes_whole turn; lanes along, up; } ray_shape;

#if LANES == 8
#define LOAD_WHOLE(p) vload8(0, p)
#else
#define LOAD_WHOLE(p) (*(p))
#endif

/* Those of LANES rays; `shadows` holds `along` of all `rays`, padded, and then `up`. */
static ray_shape shape_of(__global const uint *turns, __global const float *shadows, int ray0, int rays) {
  ray_shape s = {LOAD_WHOLE(turns + ray0), LOAD(shadows + ray0), LOAD(shadows + rays + ray0)};
  return s;
}

static response ray_response(int l, const ray_shape *ray, float bin) {
  const lanes u = TO_FLOAT(WHOLE_TO_INT((uint)l * ray->turn)) * (1.0f / 4294967296.0f);
  const lanes a = (float)l * ray->along, b = (float)l * ray->up;
  /* sin(2 pi a) sin(2 pi b) / (4 pi^2 a b), and 1 in the place of a factor where there is no shadow. */
  const lanes above = (a == 0 ? 1 : sine_of_turn(within_a_turn(a))) * (b == 0 ? 1 : sine_of_turn(within_a_turn(b)));
  const lanes below = (a == 0 ? 1 : 6.28318531f * a) * (b == 0 ? 1 : 6.28318531f * b);
  const lanes weight = bin * above / below;
  response r;
  r.real = weight * cosine_of_turn(u);
  r.imaginary = weight * sine_of_turn(u);
  return r;
}
