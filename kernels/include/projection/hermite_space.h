/* Polynomials of Hermite modes in space, packed by order: what a linear map does to them, and what
 * they are as sums of powers.
 *
 * He~_n = He_n / sqrt(n!), and a product over three dimensions. Coefficients come in graded order:
 * by a + b + c, within it (n,0,0), (n-1,1,0), (n-1,0,1), (n-2,2,0).. Since
 *
 *     He_a(x) He_b(y) He_c(z) g = (-d/dx)^a (-d/dy)^b (-d/dz)^c g,     g = exp(-|x|^2 / 2),
 *
 * a splat is a polynomial of derivatives, p(s) = sum of c_n s^n / sqrt(n!) with s for -d/dx', times a
 * Gaussian. In other coordinates u = A x' + (what a blur adds, which no derivative sees) s = A^T t,
 * so that orders do not mix: each is a homogeneous polynomial into which three linear forms are
 * put (Horner's rule). The coefficient of t^m is then that of He_m(u) itself. With the covariance
 * of u held at one, A A^T <= 1: no order grows.
 *
 * Within one order t0^(n-b-c) t1^b t2^c has the place (b + c) (b + c + 1) / 2 + c, whatever n. */

#ifndef ORDER
#define ORDER 0
#endif
#define MODES ((ORDER + 1) * (ORDER + 2) * (ORDER + 3) / 6)
/* Modes of one order, the highest. */
#define HIGHEST_MODES ((ORDER + 1) * (ORDER + 2) / 2)

static int modes_below(int order) { return order * (order + 1) * (order + 2) / 6; }

static int mode_place(int a, int b, int c) {
  return modes_below(a + b + c) + (b + c) * (b + c + 1) / 2 + c;
}

/* The place of the mode that is of order n along one dimension, and p and q along the others. */
static int place_along(int dimension, int n, int p, int q) {
  return dimension == 0 ? mode_place(n, p, q) : dimension == 1 ? mode_place(p, n, q) : mode_place(p, q, n);
}

/* Multiply a homogeneous polynomial of this degree by a linear form, in place. One term after the other:
 * with conditions inside of a single sum Intel's compiler for CPUs dies of ORDER 2 or 3. */
static void times_form(float *p, int degree, float3 form) {
  for (int j = degree + 1; j > 0; j--) {
    float *here = p + j * (j + 1) / 2, *before = here - j;
    if (j > degree) for (int c = 0; c <= j; c++) here[c] = 0;
    else for (int c = 0; c <= j; c++) here[c] *= form.x;
    for (int c = 0; c < j; c++) here[c] += form.y * before[c];
    for (int c = 0; c < j; c++) here[c + 1] += form.z * before[c];
  }
  p[0] *= form.x;
}

/* 1 / sqrt(n!). */
__constant float INVERSE_ROOT[] = {
    1, 1, 0.70710678f, 0.40824829f, 0.20412415f, 0.091287093f, 0.037267800f, 0.014085904f, 0.0049801192f};

/* Turn coefficients c~_n of He~_n(x') into those of He_m(u), u = A x': columns of A are given. */
static void map_modes(float *modes, float3 column0, float3 column1, float3 column2) {
  float powers[MODES], whole[HIGHEST_MODES], part[HIGHEST_MODES];
  powers[0] = 1;
  for (int n = 1; n <= ORDER; n++) {
    float *power = powers + modes_below(n);
    for (int k = 0; k < n * (n + 1) / 2; k++) power[k] = powers[modes_below(n - 1) + k];
    times_form(power, n - 1, column2);
  }
  for (int n = 1; n <= ORDER; n++) {
    float *given = modes + modes_below(n);
    for (int a = n; a >= 0; a--) {
      const int degree = n - a;
      for (int b = degree; b >= 0; b--) {
        const int c = degree - b, size = (c + 1) * (c + 2) / 2;
        const float *power = powers + modes_below(c);
        const float factor = given[(b + c) * (b + c + 1) / 2 + c] *
            INVERSE_ROOT[a] * INVERSE_ROOT[b] * INVERSE_ROOT[c];
        if (c > 0) times_form(part, c - 1, column1);
        for (int k = 0; k < size; k++) part[k] = (c > 0 ? part[k] : 0) + factor * power[k];
      }
      if (degree > 0) times_form(whole, degree - 1, column0);
      for (int k = 0; k < (degree + 1) * (degree + 2) / 2; k++) whole[k] = (degree > 0 ? whole[k] : 0) + part[k];
    }
    for (int k = 0; k < (n + 1) * (n + 2) / 2; k++) given[k] = whole[k];
  }
}

/* Replace He_n by powers along one dimension: He_n(x) = sum over k of (-1)^k n! / (k! (n-2k)! 2^k)
 * x^(n-2k). A coefficient takes in those two, four.. places above it, which are not yet replaced.
 * Unrolled, since clspv nests these loops wrongly where it unrolls some of them itself. */
static void to_powers(float *modes, int dimension) {
  UNROLL for (int p = 0; p <= ORDER; p++)
    for (int q = 0; q <= ORDER - p; q++)
      for (int j = 0; j <= ORDER - p - q; j++) {
        float sum = 0, factor = 1;
        for (int k = 0; j + 2 * k <= ORDER - p - q; k++) {
          const int n = j + 2 * k;
          if (k > 0) factor *= -0.5f * (n * (n - 1)) / k;
          sum += factor * modes[place_along(dimension, n, p, q)];
        }
        modes[place_along(dimension, j, p, q)] = sum;
      }
}
