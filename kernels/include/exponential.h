/* exp(-x) for x >= 0 as 2^f 2^i: the same bits on every device that rounds as IEEE says.
 *
 * i is the whole part of -x / ln 2 and f in (-1, 0] the rest; 2^f is a polynomial of degree 5 with
 * minimax relative error 7.5e-8 (2.8e-7 with float32 rounding), 2^i is added to the exponent.
 * Below 2^-126 the result is held there, so that the exponent cannot wrap. Built-in exponentials
 * are calls that spill every vector on PoCL, and native_exp has no promised error on a GPU. */

#if LANES == 8
#define AS_INT(v) as_int8(v)
#define AS_LANES(v) as_float8(v)
#else
#define AS_INT(v) as_int(v)
#define AS_LANES(v) as_float(v)
#endif

static lanes exp_minus(lanes x) {
  lanes power = x * -1.44269504f;
  power = power < -126.0f ? -126.0f : power;
  const lanes_int whole = TO_INT(power);
  const lanes f = power - TO_FLOAT(whole);
  lanes value = 0.00093878835f * f + 0.009188612f;
  value = value * f + 0.055279724f;
  value = value * f + 0.24017219f;
  value = value * f + 0.69314224f;
  value = value * f + 0.99999994f;
  return AS_LANES(AS_INT(value) + (whole << 23));
}
