/* A step of Adam along parameters that lie one behind the other; kernels/train/adam.cl says what it is.
 *
 * A kernel that makes a gradient can take the step at once, before the gradient has gone out to memory
 * and come back: of the coefficients of colours that is a quarter of what a step would move. */

#define ADAM_PARAMETERS \
  __global float *restrict m, __global float *restrict v, __global const float *restrict shares, int period, \
  float rate, float beta1, float beta2, float c1, float c2, float epsilon
#define ADAM_GIVEN {m, v, shares, period, rate, beta1, beta2, c1, c2, epsilon}

typedef struct {
  __global float *m;
  __global float *v;
  __global const float *shares;
  int period;
  float rate, beta1, beta2, c1, c2, epsilon;
} Adam;

/* Square roots as IEEE has them; the built-in one is a call, round which every vector is spilled. */
#if LANES == 8 && RIFT_POCL
static lanes roots(lanes square) {
  lanes root;
  UNROLL for (int l = 0; l < LANES; l++) ((float *)&root)[l] = __builtin_sqrtf(((const float *)&square)[l]);
  return root;
}
#else
static lanes roots(lanes square) { return sqrt(square); }
#endif

/* LANES of them from number i on, whose place in the period is given. */
static void adam_lanes(__global float *x, Adam a, ulong i, lanes g, int place) {
  const lanes m = a.beta1 * LOAD(a.m + i) + (1 - a.beta1) * g;
  const lanes v = a.beta2 * LOAD(a.v + i) + (1 - a.beta2) * g * g;
  const lanes rate = a.rate * LOAD(a.shares + place);
  STORE(a.m + i, m);
  STORE(a.v + i, v);
  STORE(x + i, LOAD(x + i) - rate * (m * a.c1) / (roots(v * a.c2) + a.epsilon));
}

#if LANES > 1
/* A single one, where fewer than LANES are left. */
static void adam_one(__global float *x, Adam a, ulong i, float g, int place) {
  const float m = a.beta1 * a.m[i] + (1 - a.beta1) * g;
  const float v = a.beta2 * a.v[i] + (1 - a.beta2) * g * g;
  const float rate = a.rate * a.shares[place];
  a.m[i] = m;
  a.v[i] = v;
  x[i] = x[i] - rate * (m * a.c1) / (sqrt(v * a.c2) + a.epsilon);
}
#endif

/* The place that is `far` farther on. */
static int place_after(int place, int far, int period) {
  place += far;
  while (place >= period) place -= period;
  return place;
}

/* Numbers begin .. end - 1, by a gradient that is an array like them. */
static void adam_between(__global float *x, Adam a, ulong begin, ulong end, __global const float *g) {
  int place = (int)(begin % (ulong)a.period);
  ulong i = begin;
  for (; i + LANES <= end; i += LANES) {
    adam_lanes(x, a, i, LOAD(g + i), place);
    place = place_after(place, LANES, a.period);
  }
#if LANES > 1
  for (; i < end; i++) {
    adam_one(x, a, i, g[i], place);
    place = place_after(place, 1, a.period);
  }
#endif
}

/* `count` of them from number i on, where a period begins, by a gradient in memory of the work-item's
 * own. */
static void adam_along(__global float *x, Adam a, ulong i, const int count, const lanes *g) {
  int place = 0;
#if LANES > 1
  int n = 0;
  for (; n + LANES <= count; n += LANES) {
    adam_lanes(x, a, i + n, g[n / LANES], place);
    place = place_after(place, LANES, a.period);
  }
  for (; n < count; n++) {
    adam_one(x, a, i + n, ((const float *)g)[n], place);
    place = place_after(place, 1, a.period);
  }
#else
  UNROLL for (int n = 0; n < count; n++) {
    adam_lanes(x, a, i + n, g[n], place);
    place = place_after(place, 1, a.period);
  }
#endif
}
