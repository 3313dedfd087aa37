/* Views as the complex columns of a Fourier transform, two views to a column, and their rays.
 *
 * Ray c is the real part of column c, and ray (columns + c) its imaginary one. Each view begins at
 * its own bin, so that the image's shadow always falls on rows 0 .. window - 1. With Z the transform
 * of a + i b, a real view has the transform (Z[l] + conj Z[-l]) / 2 and its partner
 * (Z[l] - conj Z[-l]) / 2i, both of period `length`.
 *
 * Pointers are those of LANES columns, their rows `pitch` numbers apart; `ray0` is the ray in the
 * first of them. */

/* Where views lie: which view each ray is, its first bin, and how many there are of what. */
typedef struct {
  __global const int *order, *starts;
  int rays, slice, slices, bins, window;
} layout;

static lanes load_view(__global const float *restrict views, const layout *of, int ray, int row) {
  if (ray >= of->rays) return 0;
  const int first = of->starts[ray], end = first + of->window < of->bins ? first + of->window : of->bins;
  return load_between(views + ((long)of->order[ray] * of->slices + of->slice) * of->bins, first + row, end);
}

/* Rows begin .. end - 1 of one part; off the detector and behind the last ray there are zeros. */
static void pack_views(
    __global const float *restrict views, const layout *of, __global float *restrict part, long pitch,
    int ray0, int begin, int end)
{
  for (int r = begin; r < end; r += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++) block[k] = load_view(views, of, ray0 + k, r);
    TRANSPOSE(block)
    UNROLL for (int k = 0; k < LANES; k++) STORE(part + (r + k) * pitch, block[k]);
  }
}

/* Samples begin .. ends - 1 of the rays of a part, and perhaps some behind them: turned and weighted
 * (see ray_response.h). Rays that point to the left are reflected, which makes them their
 * conjugates: `signs` is -1 for them. Rows of samples are a multiple of LANES. */
static void weigh_views(
    __global const float *restrict zr, __global const float *restrict zi, long pitch, int part, int length,
    __global float *restrict rays, __global const uint *restrict turns,
    __global const float *restrict shadows, __global const float *restrict signs,
    __global const float *restrict bins, __global const int *restrict ends, int ray0, int columns,
    int count, int samples, int begin, int most)
{
  int end = 0;
  for (int k = 0; k < LANES && ray0 + k < count; k++) end = ends[ray0 + k] > end ? ends[ray0 + k] : end;
  if (most < end) end = most;
  const ray_shape shape = shape_of(turns, shadows, ray0, 2 * columns);
  const lanes sign = LOAD(signs + ray0);
  for (int l0 = begin; l0 < end; l0 += LANES) {
    lanes re[LANES], im[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      const int l = (l0 + k) % length, m = l > 0 ? length - l : 0;
      const lanes ar = LOAD(zr + l * pitch), ai = LOAD(zi + l * pitch);
      const lanes br = LOAD(zr + m * pitch), bi = LOAD(zi + m * pitch);
      const lanes qr = part ? ai + bi : ar + br, qi = part ? br - ar : ai - bi;
      const response w = ray_response(l0 + k, &shape, bins[l0 + k]);
      re[k] = 0.5f * (qr * w.real - qi * w.imaginary);
      im[k] = 0.5f * sign * (qr * w.imaginary + qi * w.real);
    }
    TRANSPOSE(re)
    TRANSPOSE(im)
    UNROLL for (int k = 0; k < LANES; k++) {
      if (ray0 + k >= count) continue;
      __global float *out = rays + (long)(ray0 + k) * samples + l0;
      STORE(out, re[k]);
      STORE(out + (long)count * samples, im[k]);
    }
  }
}
