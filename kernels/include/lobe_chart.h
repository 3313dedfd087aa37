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
  float3 sum;         /* d + a */
  float height, fade; /* h as it is, and what is left of the modes */
  float2 stretch;     /* k / w */
  float x, y, factor;
} Chart;

static int read_chart(Chart *c, __global const float *lobe, float3 d) {
  if (!all_finite(lobe, GEOMETRY) || !read_frame(&c->frame, lobe)) return 0;
  c->sum = d + c->frame.a;
  c->height = 0.5f * dot3(c->sum, c->sum);
  c->fade = c->height < LEAST_HEIGHT ? c->height * (1 / LEAST_HEIGHT) : 1;
  const float k = sqrt(2 / larger1(c->height, LEAST_HEIGHT));
  c->stretch.x = k * power_of_e(-held(lobe[4], LEAST_LOG_WIDTH, 0));
#if LOBES == HG
  c->stretch.y = k * power_of_e(-held(lobe[5], LEAST_LOG_WIDTH, 0));
#else
  c->stretch.y = c->stretch.x;
#endif
  c->x = c->stretch.x * dot3(d, c->frame.t);
  c->y = c->stretch.y * dot3(d, c->frame.b);
  c->factor = INVERSE_ROOT_PI * power_of_e(-0.5f * (c->x * c->x + c->y * c->y));
  return 1;
}

/* All functions after the constant; 0 if the geometry has no meaning. */
static int lobe_functions(__global const float *lobe, float3 d, float *value) {
  Chart c;
  if (!read_chart(&c, lobe, d)) return 0;
  plane_modes(c.x, c.y, c.fade * c.factor, value);
  return 1;
}

/* The same of a geometry that has a meaning, and dL/dgeometry from dL/d(functions); gives dL/dd,
 * before the direction's length is held at 1. */
static float3 lobe_functions_grad(
    __global const float *lobe, float3 d, const float *by_value, float *value, __global float *grad)
{
  Chart c;
  read_chart(&c, lobe, d);
  plane_modes(c.x, c.y, c.fade * c.factor, value);
  const float3 whole = plane_slopes(c.x, c.y, c.factor, by_value);
  const float by_x = c.fade * whole.y, by_y = c.fade * whole.z;
  const float along_x = c.x * by_x, along_y = c.y * by_y;
  const float by_height =
      c.height > LEAST_HEIGHT ? -0.5f * (along_x + along_y) / c.height : whole.x * (1 / LEAST_HEIGHT);
  const float3 g = c.stretch.x * by_x * c.frame.t + c.stretch.y * by_y * c.frame.b + by_height * c.sum;
  store_frame_grad(&c.frame, g, d, grad);
#if LOBES == HG
  grad[4] = is_free(lobe[4], LEAST_LOG_WIDTH, 0) ? -along_x : 0;
  grad[5] = is_free(lobe[5], LEAST_LOG_WIDTH, 0) ? -along_y : 0;
#else
  grad[4] = is_free(lobe[4], LEAST_LOG_WIDTH, 0) ? -(along_x + along_y) : 0;
#endif
  return g;
}
