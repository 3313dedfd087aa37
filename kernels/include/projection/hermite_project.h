/* Hermite modes of a splat, and how they pass to the screen.
 *
 * With He~_n = He_n / sqrt(n!) and x' the splat's own coordinates (x = mean + F x'), a polynomial
 * is the sum of c_n He~_n(x') = c_n He~_n1(x'_1) He~_n2(x'_2) He~_n3(x'_3), in graded order: by
 * total order, within one lexicographically descending, (1,0,0), (0,1,0), (0,0,1), (2,0,0), ...
 * Times the Gaussian, each mode is a derivative of it, (-d)^n g / sqrt(n!). Projection along a ray
 * and dilation leave derivatives derivatives, so that with V = J W F and L L^T = V V^T + eps I
 * order N on the screen comes from order N in space alone, in u' = L^-1 (pixel - mean2d):
 *
 *     sum of c2_m He~_m(u') g(u'),   p2(t) = p(A^T t),   A = L^-1 V (2x3),
 *
 * with the homogeneous polynomials p(s) = sum of c_n s^n / sqrt(n!), and p2 of c2_m alike. As
 * symmetric tensors: T2_ab.. = A_ai A_bj .. T_ij.., T_n = c_n sqrt(n!) / N!. A A^T <= I, so that
 * the 2-norm of an order never grows. (Shapelets: Refregier 2003, for one plane.)
 *
 * One index after the other is contracted. After k of N, row j holds the tensor of which j of the
 * k indices are 2, k - j are 1, and N - k are still in space: entry r (r + 1) / 2 + z has r of
 * those not 1 and z of them 3, whatever N - k, so that one more index 1, 2, 3 is found 0, r + 1,
 * r + 2 places further on. Row j is as long as it was when it was made, at step j. */

#ifndef SHAPE_ORDER
#define SHAPE_ORDER 0
#endif
#ifndef COLOR_ORDER
#define COLOR_ORDER 0
#endif
/* Channels that have a polynomial; the first of all. */
#ifndef COLOR_CHANNELS
#define COLOR_CHANNELS 0
#endif

#define MODES2(order) (((order) + 1) * ((order) + 2) / 2)
#define MODES3(order) (((order) + 1) * ((order) + 2) * ((order) + 3) / 6)
#define MOST_ORDER (SHAPE_ORDER > COLOR_ORDER ? SHAPE_ORDER : COLOR_ORDER)
/* Numbers of a splat without the constants: in space, and on the screen. */
#define SHAPE_MODES (MODES3(SHAPE_ORDER) - 1)
#define COLOR_MODES (MODES3(COLOR_ORDER) - 1)
#define SCREEN_SHAPE_MODES (MODES2(SHAPE_ORDER) - 1)
#define SCREEN_COLOR_MODES (MODES2(COLOR_ORDER) - 1)
/* A row of screen_modes: i00, i10, i11 of L^-1, the shape's modes, the channels' modes. */
#define WHITENING 3
#define TABLE_LENGTH (WHITENING + SCREEN_SHAPE_MODES + SCREEN_COLOR_MODES * COLOR_CHANNELS)
/* Entries of all rows of the largest order. */
#define TENSOR_LENGTH MODES3(MOST_ORDER)

/* sqrt(k!). */
__constant float FACTORIAL_ROOT[] = {
    1, 1, 1.41421356f, 2.44948974f, 4.89897949f, 10.9544512f, 26.8328157f, 70.9929574f, 200.798406f};

/* L^-1 and the rows of A. */
typedef struct {
  lanes i00, i10, i11;
  lanes3 a0, a1;
} Whitening;

/* No difference of nearly equal numbers: |v0|^2 v1 - (v0 . v1) v0 = (v0 x v1) x v0. */
static Whitening whiten(const Gaussian *g) {
  Whitening w;
  const lanes l00 = root_of(dot_of(g->v0, g->v0) + g->eps), per_root = 1 / root_of(g->dilated);
  w.i00 = 1 / l00;
  w.i11 = l00 * per_root;
  w.a0 = times(w.i00, g->v0);
  w.i10 = -dot_of(w.a0, g->v1) * per_root;
  w.a1 = plus(cross_of(times(per_root, g->normal), w.a0), times(g->eps * w.i00 * per_root, g->v1));
  return w;
}

/* A thinner or wider splat than floats can whiten is none. */
static lanes_int whitening_is_finite(const Gaussian *g) {
  const Whitening w = whiten(g);
  return !(no_number(w.i00) | no_number(w.i10) | no_number(w.i11) | no_numbers(w.a0) | no_numbers(w.a1));
}

/* sqrt(n1! n2! n3!) with r = n2 + n3, z = n3. */
static float factor_in_space(int order, int r, int z) {
  return FACTORIAL_ROOT[order - r] * FACTORIAL_ROOT[r - z] * FACTORIAL_ROOT[z];
}

/* sqrt(m1! m2!) with m2 = j. */
static float factor_on_screen(int order, int j) { return FACTORIAL_ROOT[order - j] * FACTORIAL_ROOT[j]; }

/* Polynomials in a table: each is in every `stride`-th column from `first` on, of rows of `width`. */
typedef struct {
  int width, first, stride;
} Columns;

static Columns columns_of(int width, int first, int stride) {
  Columns c;
  c.width = width;
  c.first = first;
  c.stride = stride;
  return c;
}

static void load_order(
    lanes *tensor, __global const float *modes, const Columns at, Rows rows, int order)
{
  int p = 0;
  for (int r = 0; r <= order; r++)
    for (int z = 0; z <= r; z++, p++)
      tensor[p] = read_one(modes, at.width, at.first + p * at.stride, rows) * factor_in_space(order, r, z);
}

/* Contract the first of a row's indices with a; the row is of this degree afterwards. */
static void contract(const lanes *row, lanes3 a, int degree, lanes *out) {
  int p = 0;
  for (int r = 0; r <= degree; r++)
    for (int z = 0; z <= r; z++, p++) out[p] = a.x * row[p] + a.y * row[p + r + 1] + a.z * row[p + r + 2];
}

/* Contract so many indices of the tensor of an order. */
static void contract_order(lanes *tensor, const Whitening *w, int order, int steps) {
  lanes *newest = tensor;
  /* Unrolled, as hermite_project's orders are: clspv nests loops wrongly where it unrolls some itself. */
  UNROLL for (int k = 1; k <= steps; k++) {
    lanes *row = tensor, *next = newest + MODES2(order - k + 1);
    contract(newest, w->a1, order - k, next);
    for (int j = 0; j < k; j++) {
      contract(row, w->a0, order - k, row);
      row += MODES2(order - j);
    }
    newest = next;
  }
}
