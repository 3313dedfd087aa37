/* The factor between a view's transform and its ray of the image's spectrum.
 *
 * Sample l of `length` is l / length cycles per bin. The shadow of a pixel, a hat of half-width h
 * bins, has the spectrum sinc(h l / length)^2 (times h, which the projector's scale takes away);
 * that the image's middle is seen a fraction `turn` of 2^32 length bins behind the first row turns
 * sample l by l * turn. Rays run along the lanes; `half_shadow` is h / (2 length). */

typedef struct { lanes real, imaginary; } response;

static response ray_response(int l, lanes_whole turn, lanes half_shadow) {
  const lanes u = TO_FLOAT(WHOLE_TO_INT((uint)l * turn)) * (1.0f / 4294967296.0f);
  const lanes sinc = sinc_of_turn((float)l * half_shadow);
  response r;
  r.real = sinc * sinc * cosine_of_turn(u);
  r.imaginary = sinc * sinc * sine_of_turn(u);
  return r;
}

#if LANES == 8
#define LOAD_WHOLE(p) vload8(0, p)
#else
#define LOAD_WHOLE(p) (*(p))
#endif
