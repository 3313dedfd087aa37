/* The Fourier slice theorem on a grid: views are rays of the image's spectrum.
 *
 * The one-dimensional transform of a view is the spectrum of the image along a line through zero,
 * in the view's direction. Sample l of a ray stands at l * (step x, step y) cells of a regular grid
 * of frequencies; it is spread over the WIDTH x WIDTH cells about it (or read from them) with the
 * weights phi(x) phi(y) of a kernel of WIDTH cells. What the kernel does to the image is divided out
 * in real space (J. I. Jackson et al., IEEE Trans. Medical Imaging 10, 473, 1991).
 *
 * Positions are 32.32 fixed-point, so that spreading and reading see the same weights, bit for bit.
 * The kernel comes as a table: row r holds phi at the WIDTH cells whose first lies r / ROWS above
 * the kernel's lower end, and rows are blended. A row has eight numbers, zeros behind the last. */

#ifndef WIDTH
#define WIDTH 6
#endif
#ifndef LOG2_ROWS
#define LOG2_ROWS 9
#endif
#define TABLE_PITCH 8
/* Cells that stand before zero frequency in a row of the grid. */
#define MARGIN 8
#if LANES == 8
#ifndef BLOCK
#define BLOCK (2 * LANES)
#endif
#endif
#define FIXED_ONE ((long)1 << 32)

/* Where rays_spread puts cell x of a row of one part: a GPU as the grid is read, a CPU in blocks of
 * BLOCK columns, each with its real parts and then its imaginary ones, as pairs_of_spectrum_cpu takes
 * them. */
static long cell_at(int part, int row, int x, int rows, int columns) {
#if LANES == 8
  return ((2L * (x / BLOCK) + part) * rows + row) * BLOCK + x % BLOCK;
#else
  return ((long)part * rows + row) * columns + MARGIN + x;
#endif
}

/* The first cell that a kernel about a position reaches. */
static int first_cell(long position) {
  return (int)((position - ((long)WIDTH << 31) + FIXED_ONE - 1) >> 32);
}

/* How far that cell lies above the kernel's lower end, a fraction of 2^32. */
static uint offset_of(long position) { return (uint)(((long)WIDTH << 31) - position); }

/* The weights of cells k .. k + LANES - 1. */
static lanes weights_at(__global const float *table, uint offset, int k) {
  const float blend = (float)(int)((offset << LOG2_ROWS) >> 8) * (1.0f / 16777216.0f);
  __global const float *row = table + (offset >> (32 - LOG2_ROWS)) * TABLE_PITCH + k;
  const lanes here = LOAD(row);
  return here + blend * (LOAD(row + TABLE_PITCH) - here);
}

typedef union { lanes vector; float number[LANES]; } lane_array;

/* Numbers first .. first + LANES - 1 of a row that has them from 0 to end - 1; zero elsewhere. */
static lanes load_between(__global const float *row, int first, int end) {
  if (first >= 0 && first + LANES <= end) return LOAD(row + first);
  lane_array part;
  for (int k = 0; k < LANES; k++) part.number[k] = first + k >= 0 && first + k < end ? row[first + k] : 0;
  return part.vector;
}

/* Stores those of the numbers that such a row has. */
static void store_between(__global float *row, int first, int end, lanes values) {
  if (first >= 0 && first + LANES <= end) {
    STORE(row + first, values);
    return;
  }
  lane_array part;
  part.vector = values;
  for (int k = 0; k < LANES; k++)
    if (first + k >= 0 && first + k < end) row[first + k] = part.number[k];
}
