/* Back through the map of modes to the screen: one order of one polynomial at a time. See
 * hermite_project.h for the map, hermite_project_grad.cl for what comes in and goes out. */

/* P, the lower part of R, and G. */
typedef struct {
  float first[2];
  float xx, yx, yy;
  float3 a0, a1;
} ScreenSums;

/* The transpose of contract: a row of `degree` gains an index. */
static void expand(float *row, float3 a, int degree) {
  for (int p = MODES2(degree); p < MODES2(degree + 1); p++) row[p] = 0;
  int p = MODES2(degree) - 1;
  for (int r = degree; r >= 0; r--)
    for (int z = r; z >= 0; z--, p--) {
      const float v = row[p];
      row[p] = a.x * v;
      row[p + r + 1] += a.y * v;
      row[p + r + 2] += a.z * v;
    }
}

/* The same of another row, added to one that has the index already. */
static void expand_onto(const float *row, float3 a, int degree, float *out) {
  int p = 0;
  for (int r = 0; r <= degree; r++)
    for (int z = 0; z <= r; z++, p++) {
      out[p] += a.x * row[p];
      out[p + r + 1] += a.y * row[p];
      out[p + r + 2] += a.z * row[p];
    }
}

/* The transpose of contract_order, of all its steps. */
static void expand_order(float *tensor, const Whitening *w, int order) {
  float *newest = tensor;
  for (int j = 0; j < order; j++) newest += MODES2(order - j);
  for (int k = order; k >= 1; k--) {
    float *row = tensor;
    for (int j = 0; j < k; j++) {
      expand(row, w->a0, order - k);
      row += MODES2(order - j);
    }
    float *last = newest - MODES2(order - k + 1);
    expand_onto(newest, w->a1, order - k, last);
    newest = last;
  }
}

/* One order of one polynomial: adds to G, and gives dL/dc from `by_screen`, dL/dc2. */
static void order_grad(
    const Whitening *w, ScreenSums *sums, __global const float *modes, int order, int stride,
    const float *by_screen, float scale, __global float *out)
{
  float tensor[TENSOR_LENGTH];
  load_order(tensor, modes, order, stride);
  contract_order(tensor, w, order, order - 1);
  const float *row = tensor;
  for (int j = 0; j < order; j++) {
    /* Row j has j indices 2 of order - 1: it is m - e_1 of m = j, and m - e_2 of m = j + 1. */
    const float3 rest = (float3)(row[0], row[1], row[2]);
    sums->a0 += (order - j) * scale * by_screen[j] / factor_on_screen(order, j) * rest;
    sums->a1 += (j + 1) * scale * by_screen[j + 1] / factor_on_screen(order, j + 1) * rest;
    row += MODES2(order - j);
  }
  float *place = tensor;
  for (int j = 0; j <= order; j++) {
    place[0] = scale * by_screen[j] / factor_on_screen(order, j);
    place += MODES2(order - j);
  }
  expand_order(tensor, w, order);
  int p = 0;
  for (int r = 0; r <= order; r++)
    for (int z = 0; z <= r; z++, p++) out[(long)p * stride] = tensor[p] * factor_in_space(order, r, z);
}
