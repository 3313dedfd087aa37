/* A Fourier transform down the columns of a block of BLOCK columns, all passes at once, for CPUs.
 *
 * A block with its copy is small enough for the caches of a core: a kernel fills it from wherever
 * the data are, transforms it and empties it, and nothing in between goes to memory. Rows of a block
 * stand side by side, real and imaginary parts apart. Passes are those of fft_pass.cl. */

#include "include/fourier/butterfly.h"

#ifndef BLOCK
#define BLOCK (2 * LANES)
#endif

typedef struct { __global real *re, *im; } block;

/* All butterflies of a pass of one radix. */
#define PASS(RADIX, TRANSFORM) \
  static void pass##RADIX(block in, block out, __global const real *restrict turns, int length, int stride) { \
    const long step = (long)(length / RADIX) * BLOCK, leap = (long)stride * BLOCK; \
    for (int p = 0; p < length / RADIX / stride; p++) { \
      real wr[RADIX], wi[RADIX]; \
      UNROLL for (int k = 1; k < RADIX; k++) { \
        wr[k] = turns[2 * (k * p * stride)]; \
        wi[k] = turns[2 * (k * p * stride) + 1]; \
      } \
      for (int q = 0; q < stride * BLOCK; q += LANES) { \
        __global const real *restrict xr = in.re + p * leap + q, *restrict xi = in.im + p * leap + q; \
        __global real *restrict yr = out.re + RADIX * p * leap + q, *restrict yi = out.im + RADIX * p * leap + q; \
        sample x[RADIX]; \
        UNROLL for (int l = 0; l < RADIX; l++) { \
          x[l].r = LOAD(xr + l * step); \
          x[l].i = LOAD(xi + l * step); \
        } \
        TRANSFORM; \
        STORE(yr, x[0].r); \
        STORE(yi, x[0].i); \
        UNROLL for (int k = 1; k < RADIX; k++) { \
          const sample z = turned(x[k], wr[k], wi[k]); \
          STORE(yr + k * leap, z.r); \
          STORE(yi + k * leap, z.i); \
        } \
      } \
    } \
  }

PASS(2, transform2(x, x + 1))
PASS(3, transform3(x, x + 1, x + 2))
PASS(4, transform4(x, x + 1, x + 2, x + 3))
PASS(8, transform8(x))
PASS(9, transform9(x))

/* Transforms the first of two blocks, and says which of the two holds the result. */
static int transform_block(const block *blocks, __global const real *restrict turns, int length) {
  int at = 0;
  for (int stride = 1; stride < length; at = 1 - at) {
    const int left = length / stride;
    const int radix = left % 9 == 0 ? 9 : left % 8 == 0 ? 8 : left % 4 == 0 ? 4 : left % 3 == 0 ? 3 : 2;
    const block from = blocks[at], to = blocks[1 - at];
    if (radix == 9) pass9(from, to, turns, length, stride);
    else if (radix == 8) pass8(from, to, turns, length, stride);
    else if (radix == 4) pass4(from, to, turns, length, stride);
    else if (radix == 3) pass3(from, to, turns, length, stride);
    else pass2(from, to, turns, length, stride);
    stride *= radix;
  }
  return at;
}

/* The inverse transform, up to 1 / length. */
static int transform_block_back(const block *blocks, __global const real *restrict turns, int length) {
  const block swapped[2] = {{blocks[0].im, blocks[0].re}, {blocks[1].im, blocks[1].re}};
  return transform_block(swapped, turns, length);
}

/* The two blocks of an item, from scratch memory that holds those of all. */
#define BLOCKS_OF(item, scratch, length) \
  {{(scratch) + 4L * (item) * (length) * BLOCK, (scratch) + (4L * (item) + 1) * (length) * BLOCK}, \
   {(scratch) + (4L * (item) + 2) * (length) * BLOCK, (scratch) + (4L * (item) + 3) * (length) * BLOCK}}
