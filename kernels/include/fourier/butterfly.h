/* Fourier transforms of 2, 3, 4, 8 and 9 samples, in registers, on LANES columns at a time.
 *
 * Those of 8 and 9 are made of smaller ones (J. W. Cooley and J. W. Tukey, Math. Comput. 19, 297,
 * 1965): fewer passes over memory, which is what a long transform waits for. Samples stay in
 * order; sums run from sample 0 on, with exp(-2 pi i k l / n). */

#if DOUBLE
#define HALF_ROOT3 0.86602540378443865
#define HALF_ROOT2 0.70710678118654752
#else
#define HALF_ROOT3 0.86602540f
#define HALF_ROOT2 0.70710678f
#endif

typedef struct { lanes r, i; } sample;

static sample plus(sample a, sample b) { sample s = {a.r + b.r, a.i + b.i}; return s; }
static sample minus(sample a, sample b) { sample s = {a.r - b.r, a.i - b.i}; return s; }
/* i a */
static sample quarter_turned(sample a) { sample s = {-a.i, a.r}; return s; }
static sample turned(sample a, real r, real i) { sample s = {r * a.r - i * a.i, r * a.i + i * a.r}; return s; }

static void transform2(sample *a, sample *b) {
  const sample s = plus(*a, *b), d = minus(*a, *b);
  *a = s;
  *b = d;
}

static void transform3(sample *a, sample *b, sample *c) {
  const sample s = plus(*b, *c), d = minus(*b, *c);
  /* a - (b + c) / 2, and -i sqrt(3)/2 (b - c). */
  const sample m = {a->r - 0.5f * s.r, a->i - 0.5f * s.i};
  const sample u = {HALF_ROOT3 * d.i, -(HALF_ROOT3 * d.r)};
  *a = plus(*a, s);
  *b = plus(m, u);
  *c = minus(m, u);
}

static void transform4(sample *a, sample *b, sample *c, sample *d) {
  const sample s = plus(*a, *c), m = minus(*a, *c), t = plus(*b, *d), u = quarter_turned(minus(*d, *b));
  *a = plus(s, t);
  *b = plus(m, u);
  *c = minus(s, t);
  *d = minus(m, u);
}

/* Samples 2j and 2j + 1 apart: results k and k + 4 are sum and difference of theirs. */
static void transform8(sample *x) {
  transform4(x, x + 2, x + 4, x + 6);
  transform4(x + 1, x + 3, x + 5, x + 7);
  const sample b = x[3], c = x[5], d = x[7];
  const sample o1 = {HALF_ROOT2 * (b.r + b.i), HALF_ROOT2 * (b.i - b.r)};
  const sample o2 = {c.i, -c.r};
  const sample o3 = {HALF_ROOT2 * (d.i - d.r), -(HALF_ROOT2 * (d.r + d.i))};
  const sample e0 = x[0], e1 = x[2], e2 = x[4], e3 = x[6], o0 = x[1];
  x[0] = plus(e0, o0);
  x[1] = plus(e1, o1);
  x[2] = plus(e2, o2);
  x[3] = plus(e3, o3);
  x[4] = minus(e0, o0);
  x[5] = minus(e1, o1);
  x[6] = minus(e2, o2);
  x[7] = minus(e3, o3);
}

/* Samples 3j, 3j + 1 and 3j + 2 apart: results k, k + 3 and k + 6 are a transform of theirs. */
static void transform9(sample *x) {
  transform3(x, x + 3, x + 6);
  transform3(x + 1, x + 4, x + 7);
  transform3(x + 2, x + 5, x + 8);
  /* cos and -sin of 40, 80 and 160 degrees. */
  x[4] = turned(x[4], (real)0.76604444311897804, (real)-0.64278760968653933);
  x[5] = turned(x[5], (real)0.17364817766693035, (real)-0.98480775301220806);
  x[7] = turned(x[7], (real)0.17364817766693035, (real)-0.98480775301220806);
  x[8] = turned(x[8], (real)-0.93969262078590838, (real)-0.34202014332566873);
  transform3(x, x + 1, x + 2);
  transform3(x + 3, x + 4, x + 5);
  transform3(x + 6, x + 7, x + 8);
  sample swapped = x[1];
  x[1] = x[3], x[3] = swapped;
  swapped = x[2];
  x[2] = x[6], x[6] = swapped;
  swapped = x[5];
  x[5] = x[7], x[7] = swapped;
}
