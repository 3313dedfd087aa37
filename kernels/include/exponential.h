/* 2^x for x <= 0, as 2^f 2^i: the same bits on every device that rounds as IEEE says.
 *
 * i is the whole part of x and f in (-1, 0] the rest; 2^f is a polynomial of degree 5 with minimax
 * relative error 7.5e-8 (2.8e-7 with float32 rounding), summed in pairs so that its terms do not
 * wait for each other; 2^i is added to the exponent. x is held between -126, so that the exponent
 * cannot wrap, and 0, which rounding may pass; NaN, where the conic of a needle without width
 * overflows, becomes -126, which is next to nothing. Built-in exponentials are calls that spill every
 * vector on PoCL, and native_exp2 has no promised error on a GPU. */

#if LANES == 8
#define AS_INT(v) as_int8(v)
#define AS_LANES(v) as_float8(v)
#else
#define AS_INT(v) as_int(v)
#define AS_LANES(v) as_float(v)
#endif

static lanes power_of_two(lanes x) {
  x = x > -126.0f ? x : -126.0f;
  x = x < 0 ? x : 0;
  const lanes_int whole = TO_INT(x);
  const lanes f = x - TO_FLOAT(whole), square = f * f;
  const lanes high = 0.00093878835f * f + 0.009188612f;
  const lanes middle = 0.055279724f * f + 0.24017219f;
  const lanes low = 0.69314224f * f + 0.99999994f;
  return AS_LANES(AS_INT((high * square + middle) * square + low) + (whole << 23));
}

/* 2^x for x < 127 as 2^f 2^i with i the nearest whole number, which adding 1.5 * 2^23 leaves in the
 * lowest bits, and f in [-1/2, 1/2]; fewer steps than power_of_two. Below -126, or where x is no
 * number, it is next to nothing. Relative error 7.5e-8 before rounding. */
static lanes two_to_the(lanes x) {
  x = x > -126.0f ? x : -126.0f;
  const lanes shifted = x + 12582912.0f, f = x - (shifted - 12582912.0f);
  lanes value = 0.0013276471f * f + 0.0096755419f;
  value = value * f + 0.0555071309f;
  value = value * f + 0.2402212024f;
  value = value * f + 0.693146944f;
  value = value * f + 1.00000012f;
  return AS_LANES(AS_INT(value) + (AS_INT(shifted) << 23));
}

/* The same with a relative error of 2.6e-6, for -126 <= x < 127; elsewhere any number, or none. */
static lanes two_to_about(lanes x) {
  const lanes shifted = x + 12582912.0f, f = x - (shifted - 12582912.0f);
  lanes value = 0.00957010956f * f + 0.0559178988f;
  value = value * f + 0.24024745f;
  value = value * f + 0.69312181f;
  value = value * f + 0.999999261f;
  return AS_LANES(AS_INT(value) + (AS_INT(shifted) << 23));
}

/* e^x, held to what a float32 holds: x = n ln 2 + r, |r| <= ln(2) / 2, and Cephes' polynomial of
 * degree 6 (Moshier 1989), to 2e-7. What is no number has e^-87. */
static lanes power_of_e(lanes x) {
  x = x > -87 ? x : -87;
  x = x < 88 ? x : 88;
  const lanes_int n = TO_INT(1.44269504f * x + (x < 0 ? (lanes)-0.5f : (lanes)0.5f));
  /* ln 2 in two parts, of which the first times n is exact. */
  const lanes whole = TO_FLOAT(n), r = x - whole * 0.693359375f + whole * 2.12194440e-4f;
  const lanes high = (1.9875691e-4f * r + 1.3981999e-3f) * r + 8.3334519e-3f;
  const lanes low = (high * r + 4.1665796e-2f) * r + 1.6666666e-1f;
  return ((low * r + 0.5f) * r * r + r + 1) * AS_LANES((n + 127) << 23);
}
