/* What a camera's optics pass of incoherent light: diffraction, square pixels, a disc of defocus.
 *
 * Each is a number in -1 .. 1 by the frequency times a length: the overlap of two discs
 * (2 / pi) (acos v - v sqrt(1 - v^2)), the sinc sin(pi t) / (pi t) and the Airy amplitude
 * 2 J1(pi t) / (pi t) (Goodman, Introduction to Fourier Optics, chapter 6), for defocus of
 * t = blur k (1 - k / cutoff)
 * (Stokseth, J. Opt. Soc. Am. 59, 1314, 1969). Polynomials are least
 * squares at Chebyshev's points; errors with float32 rounding are below 4e-7 of the value at zero.
 * From t = 5/4 on Bessel functions come from Hankel's form, J_n = (P cos chi - Q sin chi)
 * sqrt(2 / (pi y)) with chi = y - n pi / 2 - pi / 4, where P and t Q are polynomials in 1 / t^2. */

#include "include/turn.h"

/* sin(pi t) and cos(pi t), both with one sign for all purposes here: -1 at times, alike. */
typedef struct {
  lanes sine, cosine;
} half_turn;

static half_turn half_turn_of(lanes t) {
  const lanes u = within_a_turn(0.5f * t);
  half_turn h;
  h.sine = sine_of_turn(u);
  h.cosine = cosine_of_turn(u);
  return h;
}

/* Diffraction at v >= 0 of the cut-off. */
static lanes diffraction(lanes v) {
  const lanes w = v < 1 ? 1 - v : 0;
  return w * sqrt(w) * (1.20042174f + w * (-0.180061591f + w * (-0.0161027009f +
      w * (-0.00298116774f + w * (-0.00117938446f + w * (0.000248881172f +
      w * -0.000345752004f))))));
}

/* Its derivative by v. */
static lanes diffraction_slope(lanes v) {
  const lanes height = (1 - v) * (1 + v);
  return -1.27323954f * sqrt(height > 0 ? height : 0);
}

/* The sinc, t > 0. */
static lanes square_pixel(half_turn h, lanes t) { return h.sine / (3.14159265f * t); }

/* Its derivative by t. */
static lanes square_pixel_slope(half_turn h, lanes t) {
  const lanes x = t * t;
  const lanes near = t * (-3.28986813f + x * (3.2469697f + x * (-1.14451079f + x * (0.209180199f +
      x * (-0.0234407786f + x * 0.00170937377f)))));
  return t < 0.5f ? near : (h.cosine - square_pixel(h, t)) / t;
}

/* The Airy amplitude, t > 0. */
static lanes defocus(half_turn h, lanes t) {
  const lanes x = t < 1.25f ? t * t : 1;
  const lanes near = 1 + x * (-1.23370055f + x * (0.507339014f + x * (-0.104317393f +
      x * (0.0128696081f + x * (-0.00105841925f + x * (6.21106059e-05f + x * (-2.69294895e-06f +
      x * 7.73727262e-08f)))))));
  const lanes far = t < 1.25f ? 1.25f : t, z = 1 / (far * far);
  const lanes p = 1 + z * (0.0118712f + z * (-0.00144640718f + z * (0.000514786251f + z * -0.000158516847f)));
  const lanes q = (0.119366175f + z * (-0.00330429463f + z * (0.000866958618f +
      z * (-0.00042673785f + z * 0.000149809399f)))) / far;
  const lanes wave = p * (h.sine - h.cosine) + q * (h.sine + h.cosine);
  return t < 1.25f ? near : 0.202642367f * wave * z * sqrt(far);
}

/* Its derivative by t, -2 J2(pi t) / t. */
static lanes defocus_slope(half_turn h, lanes t) {
  const lanes x = t < 1.25f ? t * t : 1;
  const lanes near = t * (-2.4674011f + x * (2.02935606f + x * (-0.625904376f + x * (0.102956908f +
      x * (-0.0105842443f + x * (0.000745356885f + x * (-3.77080493e-05f +
      x * 1.23811593e-06f)))))));
  const lanes far = t < 1.25f ? 1.25f : t, z = 1 / (far * far);
  const lanes p = 1 + z * (-0.0831115027f + z * (0.00320666274f + z * (-0.000897784642f + z * 0.000256284787f)));
  const lanes q = (0.596831083f + z * (0.00991717828f + z * (-0.00162732026f +
      z * (0.000691528915f + z * -0.000230701895f)))) / far;
  const lanes wave = q * (h.sine - h.cosine) - p * (h.sine + h.cosine);
  return t < 1.25f ? near : -0.636619772f * wave * z * sqrt(far);
}
