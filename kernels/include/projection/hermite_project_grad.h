/* Back through the map of modes to the screen: one order of one polynomial at a time. See
 * hermite_project.h for the map, hermite_project_grad.cl for what comes in and goes out. */

/* P, the lower part of R, and G. */
typedef struct {
  lanes first[2];
  lanes xx, yx, yy;
  lanes3 a0, a1;
} ScreenSums;

/* The transpose of contract: a row of `degree` gains an index. */
static void expand(lanes *row, lanes3 a, int degree) {
  for (int p = MODES2(degree); p < MODES2(degree + 1); p++) row[p] = 0;
  int p = MODES2(degree) - 1;
  for (int r = degree; r >= 0; r--)
    for (int z = r; z >= 0; z--, p--) {
      const lanes v = row[p];
      row[p] = a.x * v;
      row[p + r + 1] += a.y * v;
      row[p + r + 2] += a.z * v;
    }
}

/* The same of another row, added to one that has the index already. */
static void expand_onto(const lanes *row, lanes3 a, int degree, lanes *out) {
  int p = 0;
  for (int r = 0; r <= degree; r++)
    for (int z = 0; z <= r; z++, p++) {
      out[p] += a.x * row[p];
      out[p + r + 1] += a.y * row[p];
      out[p + r + 2] += a.z * row[p];
    }
}

/* The transpose of contract_order, of all its steps. */
static void expand_order(lanes *tensor, const Whitening *w, int order) {
  lanes *newest = tensor;
  for (int j = 0; j < order; j++) newest += MODES2(order - j);
  for (int k = order; k >= 1; k--) {
    lanes *row = tensor;
    for (int j = 0; j < k; j++) {
      expand(row, w->a0, order - k);
      row += MODES2(order - j);
    }
    lanes *last = newest - MODES2(order - k + 1);
    expand_onto(newest, w->a1, order - k, last);
    newest = last;
  }
}

/* One order of one polynomial: adds to G, and gives dL/dc from `by_screen`, dL/dc2, where a splat is
 * drawn. */
static void order_grad(
    const Whitening *w, ScreenSums *sums, __global const float *modes, const Columns at, Rows rows,
    lanes_int drawn, int order, const lanes *by_screen, float scale, __global float *out)
{
  lanes tensor[TENSOR_LENGTH];
  load_order(tensor, modes, at, rows, order);
  contract_order(tensor, w, order, order - 1);
  const lanes *row = tensor;
  for (int j = 0; j < order; j++) {
    /* Row j has j indices 2 of order - 1: it is m - e_1 of m = j, and m - e_2 of m = j + 1. */
    const lanes3 rest = lanes3_of(row[0], row[1], row[2]);
    const float along0 = (order - j) * scale / factor_on_screen(order, j);
    const float along1 = (j + 1) * scale / factor_on_screen(order, j + 1);
    sums->a0 = plus(sums->a0, times(along0 * by_screen[j], rest));
    sums->a1 = plus(sums->a1, times(along1 * by_screen[j + 1], rest));
    row += MODES2(order - j);
  }
  lanes *place = tensor;
  for (int j = 0; j <= order; j++) {
    place[0] = scale / factor_on_screen(order, j) * by_screen[j];
    place += MODES2(order - j);
  }
  expand_order(tensor, w, order);
  int p = 0;
  for (int r = 0; r <= order; r++)
    for (int z = 0; z <= r; z++, p++) {
      const lanes by = tensor[p] * factor_in_space(order, r, z);
      write_one(out, at.width, at.first + p * at.stride, rows, drawn ? by : 0);
    }
}
