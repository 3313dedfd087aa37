/* Modes on Lambert's chart about an axis: one lobe with a frame and one or two widths.
 *
 *     (x, y) = k (d . t / w1, d . b / w2),   k = sqrt(2 / h),   h = 1 + d . a = |d + a|^2 / 2,
 *
 * where the last form keeps its digits near the antipode. d(k) = -k / (2 h) dh, and along the
 * sphere dh/dd = d + a, in which nothing cancels either. h is held at LEAST_HEIGHT, below which
 * the modes fade with h / LEAST_HEIGHT: there the chart has no one value. Widths are held between
 * e^LEAST_LOG_WIDTH = 0.02 and 1, and have no gradient beyond. */

#define LEAST_HEIGHT 1e-4f
#define LEAST_LOG_WIDTH -3.9120230054281460f

#if LOBES == HG
#define GEOMETRY 6
#else
#define GEOMETRY 5
#endif

typedef struct {
  Frame frame;
  lanes3 sum;         /* d + a */
  lanes height, fade; /* h as it is, and what is left of the modes */
  lanes stretch_x, stretch_y; /* k / w */
  lanes x, y, factor;
} Chart;

static lanes_int read_chart(Chart *c, const lanes *lobe, lanes3 d) {
  const lanes_int meant = read_frame(&c->frame, lobe) & all_finite(lobe, GEOMETRY);
  c->sum = plus(d, c->frame.a);
  c->height = 0.5f * dot_of(c->sum, c->sum);
  c->fade = c->height < LEAST_HEIGHT ? c->height * (1 / LEAST_HEIGHT) : 1;
  const lanes k = root_of(2 / larger(c->height, LEAST_HEIGHT));
  c->stretch_x = k * power_of_e(-held(lobe[4], LEAST_LOG_WIDTH, 0));
#if LOBES == HG
  c->stretch_y = k * power_of_e(-held(lobe[5], LEAST_LOG_WIDTH, 0));
#else
  c->stretch_y = c->stretch_x;
#endif
  c->x = c->stretch_x * dot_of(d, c->frame.t);
  c->y = c->stretch_y * dot_of(d, c->frame.b);
  c->factor = INVERSE_ROOT_PI * power_of_e(-0.5f * (c->x * c->x + c->y * c->y));
  return meant;
}

/* All functions after the constant; false where the geometry has no meaning. */
static lanes_int lobe_functions(const lanes *lobe, lanes3 d, lanes *value) {
  Chart c;
  const lanes_int meant = read_chart(&c, lobe, d);
  plane_modes(c.x, c.y, c.fade * c.factor, value);
  return meant;
}

/* The same of a geometry that has a meaning, and dL/dgeometry from dL/d(functions); gives dL/dd,
 * before the direction's length is held at 1. */
static lanes3 lobe_functions_grad(
    const lanes *lobe, lanes3 d, const lanes *by_value, lanes *value, lanes *grad)
{
  Chart c;
  read_chart(&c, lobe, d);
  plane_modes(c.x, c.y, c.fade * c.factor, value);
  const lanes3 whole = plane_slopes(c.x, c.y, c.factor, by_value);
  const lanes by_x = c.fade * whole.y, by_y = c.fade * whole.z;
  const lanes along_x = c.x * by_x, along_y = c.y * by_y;
  const lanes by_height = c.height > LEAST_HEIGHT ? -0.5f * (along_x + along_y) / c.height
                                                  : whole.x * (1 / LEAST_HEIGHT);
  const lanes3 flat = plus(times(c.stretch_x * by_x, c.frame.t), times(c.stretch_y * by_y, c.frame.b));
  const lanes3 g = plus(flat, times(by_height, c.sum));
  frame_grad(&c.frame, g, d, grad);
#if LOBES == HG
  grad[4] = if_free(lobe[4], LEAST_LOG_WIDTH, 0, -along_x);
  grad[5] = if_free(lobe[5], LEAST_LOG_WIDTH, 0, -along_y);
#else
  grad[4] = if_free(lobe[4], LEAST_LOG_WIDTH, 0, -(along_x + along_y));
#endif
  return g;
}
