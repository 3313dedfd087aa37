/* The tiles of a row whose pixel centres a splat's ellipse reaches.
 *
 * With (dx, dy) from its mean, conic (a, b; b, c) and half sides (ex, ey) of its box, the ellipse
 * outside of which a splat counts nowhere has at a row dy
 *
 *     slope dy +- reach sqrt(1 - (dy / ey)^2),    slope = -b / a,    reach = ex sqrt(1 - b^2 / (a c)),
 *
 * and is widest to the right, dx = ex, at dy = summit = -(b / c) ex, to the left at -summit: what
 * screen_record.h says of columns. Between two rows its edge is concave, so that the farthest it gets
 * is at the row nearest to that summit.
 *
 * A tile listed too often costs time and nothing else, one left out is a hole in the picture. So rows
 * and columns have a hundredth of a pixel to spare and what rounding may take of the numbers that they
 * are sums of, roots are up to 0.4 % too large, and their arguments get more than the rasterizers give
 * them (screen_record.h). What is no number reaches as far as the box. */

#define PIXEL_MARGIN 0.01f
#define SHARE_MARGIN 1e-6f
#define ROOT_MARGIN 4e-6f

/* Columns are counted in tiles: the ellipse's left side is at left + slope dy - reach sqrt(..), its
 * right side at right + slope dy + reach sqrt(..). A tile is reached from the left where its first
 * centre is not beyond the right side, and from the right where its last centre is not beyond the
 * left one. Rows are counted in pixels, `first` and `last` are the centres of row 0 and -1. */
typedef struct {
  lanes left, right, slope, summit, reach, first, last, ey, per_ey;
} Ellipse;

/* sqrt(v), or up to 0.4 % more, for v >= ROOT_MARGIN: one step of Newton's from the exponent halved. */
static lanes root_above(lanes v) {
  v = v > ROOT_MARGIN ? v : ROOT_MARGIN;
  const lanes guess = AS_LANES(0x5f375a86 - (AS_INT(v) >> 1));
  return v * (guess * (1.503f - 0.5f * v * guess * guess));
}

/* Of a splat's row of the screen, for tiles of so many pixels along a side. */
static Ellipse ellipse_of(const lanes *row, float edge) {
  const lanes x = row[0], y = row[1], a = row[2], b = row[3], c = row[4], ex = row[6], ey = row[7];
  const float per_edge = 1 / edge;
  const lanes ratio = -b / c, lean = -b / a;
  const lanes beside = PIXEL_MARGIN + SHARE_MARGIN * (absolute(x) + ex);
  const lanes above = PIXEL_MARGIN + SHARE_MARGIN * (absolute(y) + ey);
  Ellipse e;
  e.left = (x - beside + 0.5f) * per_edge;
  e.right = (x + beside - 0.5f) * per_edge + 1;
  e.slope = lean * per_edge;
  e.summit = ratio * ex;
  e.reach = ex * root_above((1 + ROOT_MARGIN) - lean * ratio) * per_edge;
  e.first = 0.5f - y - above;
  e.last = -0.5f - y + above;
  e.ey = ey;
  e.per_ey = 1 / ey;
  return e;
}

/* Half of what the ellipse has of a row. */
static lanes half_of_row(const Ellipse *e, lanes dy) {
  const lanes share = dy * e->per_ey;
  return e->reach * root_above((1 + ROOT_MARGIN) - share * share);
}

/* The columns of tiles between x0 and x1 that are reached in the rows of tiles from top to bottom. */
static void reached_columns(
    const Ellipse *e, float edge, lanes_int top, lanes_int bottom, lanes x0, lanes x1, lanes_int *begin,
    lanes_int *end)
{
  const lanes first = TO_FLOAT(top) * edge + e->first, last = TO_FLOAT(bottom) * edge + e->last;
  const lanes low = first > -e->ey ? first : -e->ey, high = last < e->ey ? last : e->ey;
  lanes at_left = -e->summit > low ? -e->summit : low, at_right = e->summit > low ? e->summit : low;
  at_left = at_left < high ? at_left : high;
  at_right = at_right < high ? at_right : high;
  lanes left = e->left + e->slope * at_left - half_of_row(e, at_left);
  lanes right = e->right + e->slope * at_right + half_of_row(e, at_right);
  left = left > x0 ? left : x0;
  left = left < x1 ? left : x1;
  right = right < x1 ? right : x1;
  right = right > x0 ? right : x0;
  *begin = TO_INT(left);
  *end = low > high ? 0 : TO_INT(right);
}
