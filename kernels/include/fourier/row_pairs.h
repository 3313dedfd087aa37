/* Pairs of image rows between the two halves of the inverse transform, and the image they become.
 *
 * After the transform along y, row y of the grid is the half spectrum R of a real image row. With
 * the rows of a pair, Z = R1 + i R2 has R1's row as the real part of its transform and R2's as the
 * imaginary one; the other half of Z is conj R1 + i conj R2. Pairs stand along the lanes, so that
 * the next transform runs down the columns:
 *
 *     Z[x][c] = R1 + i R2,  Z[edge - x][c] = conj R1 + i conj R2,  rows c and c + pairs.
 *
 * Image row c is row (c - middle) of the periodic grid, image column x is row (x - middle) of the
 * pairs' transform. */

static lanes row_of(__global const float *column, long pitch, int c, int height, int middle, int rows) {
  if (c >= height) return 0;
  return LOAD(column + (c >= middle ? c - middle : c - middle + rows) * pitch);
}

/* Frequencies x .. x + LANES - 1 of pairs c .. c + LANES - 1. `re` and `im` are the grid's columns
 * from x on, their rows `pitch` apart; `zr` and `zi` are the pairs' from c on, their rows `leap` apart. */
static void fold_pairs(
    __global const float *re, __global const float *im, long pitch, int rows,
    __global float *zr, __global float *zi, long leap, int edge,
    int x, int c, int pairs, int height, int middle)
{
  lanes ar[LANES], ai[LANES], br[LANES], bi[LANES];
  UNROLL for (int k = 0; k < LANES; k++) {
    ar[k] = row_of(re, pitch, c + k, height, middle, rows);
    ai[k] = row_of(im, pitch, c + k, height, middle, rows);
    br[k] = row_of(re, pitch, c + k + pairs, height, middle, rows);
    bi[k] = row_of(im, pitch, c + k + pairs, height, middle, rows);
  }
  TRANSPOSE(ar)
  TRANSPOSE(ai)
  TRANSPOSE(br)
  TRANSPOSE(bi)
  UNROLL for (int k = 0; k < LANES; k++) {
    if (x + k > edge / 2) continue;
    STORE(zr + (x + k) * leap, ar[k] - bi[k]);
    STORE(zi + (x + k) * leap, ai[k] + br[k]);
    if (x + k == 0 || x + k == edge / 2) continue;
    STORE(zr + (edge - x - k) * leap, ar[k] + bi[k]);
    STORE(zi + (edge - x - k) * leap, br[k] - ai[k]);
  }
}

/* Pixels x .. x + LANES - 1 of rows row .. row + LANES - 1 of a slice, from one part of a pairs'
 * transform. `down` and `across` divide out what the gridding's kernel does to the image. */
static void crop_pairs(
    __global const float *part, long leap, int edge, __global float *restrict slice,
    __global const float *restrict down, __global const float *restrict across,
    int x, int row, int height, int width, int middle)
{
  lanes block[LANES];
  UNROLL for (int k = 0; k < LANES; k++) {
    const int from = x + k < middle ? x + k - middle + edge : x + k - middle;
    block[k] = x + k < width ? LOAD(part + from * leap) : (lanes)0;
  }
  TRANSPOSE(block)
  const lanes weight = load_between(across, x, width);
  for (int k = 0; k < LANES; k++)
    if (row + k < height)
      store_between(slice + (long)(row + k) * width, x, width, down[row + k] * weight * block[k]);
}
