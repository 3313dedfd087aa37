/* Sines of angles given in turns, by a polynomial: built-in ones are slow calls on some drivers.
 *
 * sin(2 pi u) is odd about zero and even about a quarter turn, so that a polynomial for a quarter on
 * either side is all there is to know; its error is 1e-11 (least squares at Chebyshev's points). */

#if LANES == 8
typedef uint8 lanes_whole;
#define WHOLE_TO_INT(v) as_int8(v)
#define INT_TO_WHOLE(v) as_uint8(v)
#else
typedef uint lanes_whole;
#define WHOLE_TO_INT(v) ((int)(v))
#define INT_TO_WHOLE(v) ((uint)(v))
#endif

/* sin(2 pi u) for |u| <= 1/2. */
static lanes sine_of_turn(lanes u) {
  const lanes v = u > 0.25f ? 0.5f - u : (u < -0.25f ? -0.5f - u : u);
  const lanes s = v * v;
  return v * (6.28318531f + s * (-41.3417019f + s * (81.6052094f + s * (-76.703666f +
      s * (41.9999608f + s * -14.336856f)))));
}

/* cos(2 pi u) for |u| <= 1/2. */
static lanes cosine_of_turn(lanes u) { return sine_of_turn(0.25f - absolute(u)); }

/* What is left of any u, up to 2^30, when whole turns are taken away. */
static lanes within_a_turn(lanes u) { return u - TO_FLOAT(floor_int(u + 0.5f)); }

/* sin(2 pi u) / (2 pi u). */
static lanes sinc_of_turn(lanes u) {
  const lanes value = sine_of_turn(within_a_turn(u)) / (6.28318531f * (u == 0 ? 1 : u));
  return u == 0 ? 1 : value;
}
