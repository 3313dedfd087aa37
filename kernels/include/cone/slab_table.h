/* The slab table: a view of a cone stretched so that backprojection needs no gathers.
 *
 * A source at distance R from the axis looks at a detector at distance S. Walk the volume in slabs,
 * planes across the axis (x or y) that the view mainly looks along; b is a slab's coordinate, b_s
 * the source's, and a counts the lines of a slab, which run along z. The ray of detector column u
 * has the slope d(u) across the slabs: from source to detector it passes S |d(u)| of them. A point
 * of depth D lies on the ray of its column, so that D = |b - b_s| / |d(u)|, and the row at which it
 * is seen,
 *
 *     v = S (z - z_s) / D = |d(u)| * S (z - z_s) / |b - b_s|,
 *
 * is a product: one factor belongs to the column, the other to the slab. So stretch the view once,
 * column by column, by the first factor,
 *
 *     T[r][u] = gain(u) * sum over rows i of kernel(step(u) (r + first) + center - i) P[i][u],
 *
 * in which step(u) is |d(u)| times the table's pitch, and gain(u) its square. In T a whole slab has
 * one magnification: its samples meet the rows r at equal steps, whatever the line, and the columns
 * at places that are the same for all z of a line,
 *
 *     out[a][z] += A / (b - b_s)^2 * sum over columns and rows of  f(a, u) g(z, r) T[r][u],
 *
 * f and g being the shares of a sample's footprint in columns and in rows. The blend of rows takes
 * columns as lanes, the blend of columns takes z as lanes: no gathers. With A = dV S^2 / (p_u p_v)
 * and the length of a ray in units of its reach, |(S, u, v)| / S, multiplied into P, this is the
 * transpose of line integrals; the projector is the transpose of these steps in reverse order.
 *
 * A sample's footprint lies in TAPS columns from its `place` on. The first takes what the others
 * leave; `shares` has TAPS - 1 runs of numbers, one for each sample of a slab. Rows have ROW_TAPS
 * alike. Both come from slab_places, once for both halves of the pair, which therefore read the same
 * numbers.
 *
 * Table entries of samples that the detector does not see are zeros beyond its edges. On a CPU the
 * columns of a table are contiguous, on a GPU its rows, along which its items lie. */

#ifndef TAPS
#define TAPS 2
#endif
#ifndef ROW_TAPS
#define ROW_TAPS 2
#endif
/* Whether the rows of tables are further apart than the detector's. */
#ifndef WIDE
#define WIDE 0
#endif

/* Whether a table's rows as far as the detector reaches, half a row beyond its first and last, are
 * read as if it went on in a straight line, for the cubic's taps beyond its ends. */
#ifndef CONTINUED
#define CONTINUED 0
#endif

#if LANES == 8
#define ENTRY(view, row, column) (((long)(view) * rows + (row)) * columns + (column))
#else
#define ENTRY(view, row, column) (((long)(view) * columns + (column)) * rows + (row))
#endif

/* Keys' cubic convolution kernel (IEEE Trans. Acoust. Speech Signal Process. 29, 1981), and 24 times
 * its integral from 0 on. It reaches 2 samples to either side. */
#define KERNEL_REACH 2.0f
static lanes cubic_kernel(lanes distance) {
  const lanes d = absolute(distance);
  const lanes near = 1.0f + d * d * (1.5f * d - 2.5f);
  const lanes far = 2.0f + d * (-4.0f + d * (2.5f - 0.5f * d));
  const lanes inside = d < 1.0f ? near : far;
  return d < KERNEL_REACH ? inside : (lanes)0;
}

static lanes cubic_integral(lanes distance) {
  const lanes far = absolute(distance);
  const lanes d = far < KERNEL_REACH ? far : (lanes)KERNEL_REACH;
  const lanes near = d * (24.0f + d * d * (9.0f * d - 20.0f));
  const lanes beyond = d * (48.0f + d * (d * (20.0f - 3.0f * d) - 48.0f)) - 4.0f;
  const lanes found = d < 1.0f ? near : beyond;
  return distance < 0.0f ? -found : found;
}

/* Asks for the places and shares of `count` samples, before they are needed: each item takes runs
 * that are too short and too far apart for a CPU to see them coming. */
#define IN_CACHE_LINE (64 / (int)sizeof(real))
static void ask_for(
    __global const int *places, __global const real *shares, int taps, int samples, int count)
{
  for (int i = 0; i < count; i += IN_CACHE_LINE) {
    PREFETCH(places + i);
    UNROLL for (int t = 0; t < taps - 1; t++) PREFETCH(shares + (long)t * samples + i);
  }
}

/* The least and the largest of LANES numbers. */
#if LANES == 8
static real least(lanes v) {
  real found = v.s0;
  UNROLL for (int n = 1; n < 8; n++) found = ((real *)&v)[n] < found ? ((real *)&v)[n] : found;
  return found;
}
static real largest(lanes v) { return -least(-v); }
#else
#define least(v) (v)
#define largest(v) (v)
#endif

/* Weight of detector row i in table row r of a column; those of a table's row add up to 1 over all
 * rows, also those that no detector has. Rows one detector row apart are interpolated; of WIDE 1 the
 * kernel is as wide as their step, integrated over the detector's rows. */
static lanes plain_row_weight(int r, lanes step, real center, int i) {
  const lanes away = step * (real)r + (center - (real)i);
#if WIDE
  return (cubic_integral((away + 0.5f) / step) - cubic_integral((away - 0.5f) / step)) / 24.0f;
#else
  return cubic_kernel(away);
#endif
}

/* The same with what a row takes for the two beyond each of the detector's ends, n rows beyond the
 * outermost: n + 1 times that less n times its neighbour, or that alone of a single row. Both
 * stretching kernels ask here, so that they weight alike. */
static lanes row_weight(int r, lanes step, real center, int i, int detector_rows) {
  lanes weight = plain_row_weight(r, step, center, i);
#if CONTINUED
  const int last = detector_rows - 1;
  const lanes place = step * (real)r + center, none = 0;
  UNROLL for (int n = 1; n < 3; n++) {
    const real own = last > 0 ? n + 1 : 1, inner = -n;
    if (i < 2) {
      const lanes beyond = (i == 0 ? own : inner) * plain_row_weight(r, step, center, -n);
      weight = weight + (place < -0.5f ? none : (place > last + 0.5f ? none : beyond));
    }
    if (i > last - 2) {
      const lanes beyond = (i == last ? own : inner) * plain_row_weight(r, step, center, last + n);
      weight = weight + (place < -0.5f ? none : (place > last + 0.5f ? none : beyond));
    }
  }
#endif
  return weight;
}

/* Detector rows to either side of a table's row that have such weights. */
#if WIDE
static lanes row_reach(lanes step) { return KERNEL_REACH * step + 0.5f; }
#else
static lanes row_reach(lanes step) { return (lanes)KERNEL_REACH; }
#endif
