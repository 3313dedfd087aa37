/* Composite the splats of a tile front to back; driver for CPUs.
 *
 *     light: C = sum of w c + T background,  w = alpha T,  T the product of (1 - alpha) so far;
 *     ADDITIVE: C = sum of weight Q exp(-sigma) c, whatever the order (line integrals of X-rays);
 *     MEDIAN: the last channel is c of the splat with which T falls to a half (include/raster/alpha.h).
 *
 * Index space: (tiles), of the rows of tiles from first_tile_row on; each item owns one. A batch of
 * the tile's entries is read once, and for each block of 4 x ROWS pixels the few that touch it are
 * listed (include/raster/block_lists.h). The block's pixels then stay in registers while its list
 * is gone through, which is what makes this fast: no load or store of a pixel for each splat, and
 * vectors that do not wait for each other (include/raster/block_splat.h says what a splat does to
 * them).
 *
 * A finished pixel keeps its transmittance with the sign turned, which makes every later share
 * negative or zero and is dropped with it. A block is left when all its pixels are finished, a
 * tile when all its blocks are; pixels outside of the image are finished from the start.
 *
 * A pixel and a splat have `stride` channels, of which this launch does CHANNELS from `first`; with
 * PACKED they are in the splats' records. Written for each pixel: image (CHANNELS numbers), the
 * final transmittance, and one past the last of the tile's entries that may have changed it, where
 * the gradient begins its way back. These arrays begin with row `above` of the image.
 *
 * Buffers: image[min(height, (first_tile_row + along0 / tiles_x) * TILE) - above, width, stride],
 * transmittance, last[min(height, (first_tile_row + along0 / tiles_x) * TILE) - above, width], packed,
 * modes, features[*], background[stride], entries[*], starts[along0 + 1]. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/raster/alpha.h"
#include "include/raster/screen_record.h"
#include "include/transpose.h"
#include "include/raster/hermite_edge.h"
#include "include/raster/hermite_modes.h"
#include "include/raster/hermite_alpha.h"
#include "include/raster/pixel_blocks.h"
#include "include/raster/block_lists.h"
#include "include/raster/block_splat.h"

/* Splats between two looks at whether a block is finished. */
#define PATIENCE 8
/* Splats that go through the steps of compositing together: how far off they are, what they hide, what
 * each takes of the light that is left, and colours. A step is a loop whose numbers fit 16 registers,
 * and but for the third no splat waits for the one before it. Modes have polynomials of their own
 * along each column, which would have to be kept: they go one by one. */
#define AT_ONCE (MODAL ? 1 : PATIENCE)

/* Pixels that nothing hides yet; the blocks that have some are returned, a bit for each. */
static ulong clear_blocks(lanes (*state)[VECTORS][1 + CHANNELS], lanes_int (*end)[VECTORS], Window window) {
  ulong going = 0;
  for (int block = 0; block < BLOCKS; block++) {
    const lanes x = window.x + block_x(block);
    lanes y = window.y + block_y(block);
    UNROLL for (int v = 0; v < VECTORS; v++) {
      const lanes_int inside = (x < window.width) & (y < window.height);
      const lanes t = inside ? (lanes)1.0f : (lanes)-1.0f;
      going |= (ulong)any_positive(AS_INT(t)) << block;
      state[block][v][0] = t;
      end[block][v] = 0;
      UNROLL for (int n = 0; n < CHANNELS; n++) state[block][v][1 + n] = 0;
      y = y + 2.0f;
    }
  }
  return going;
}

/* Write a block's pixels, row by row; `looked` entries of the tile there are. */
static void write_block(
    lanes (*state)[1 + CHANNELS], const lanes_int *end, int block, Window window, int above, int stride,
    int first, int looked, __global const float *background, __global float *image,
    __global float *transmittance, __global int *last)
{
  const Rows rows = rows_of(window, block);
  for (int row = 0; row < rows.down; row++) {
    const long pixel = rows.first + (long)(row - above) * window.width;
    const float *numbers = (const float *)state[row / 2] + row % 2 * 4;
    const int *ends = (const int *)&end[row / 2] + row % 2 * 4;
    __global float *out = image + pixel * stride + first;
    for (int k = 0; k < rows.across; k++) {
      const float rest = numbers[k] < 0 ? -numbers[k] : numbers[k];
      transmittance[pixel + k] = rest;
      last[pixel + k] = ADDITIVE || SMOOTH ? looked : ends[k];
      UNROLL for (int n = 0; n < CHANNELS; n++)
        out[k * stride + n] = numbers[8 * (1 + n) + k] + (ADDITIVE ? 0 : rest * background[first + n]);
    }
  }
}

/* Composite a list of splats onto a block; whether any pixel goes on. */
static int draw_block(
    lanes (*state)[1 + CHANNELS], lanes_int *end, const Batch *batch, const ushort *list, int length,
    int block, int before, float most)
{
  const lanes px = block_x(block), py = block_y(block);
  lanes t[VECTORS], color[VECTORS][CHANNELS];
  lanes_int last[VECTORS];
  UNROLL for (int v = 0; v < VECTORS; v++) {
    t[v] = state[v][0];
    last[v] = end[v];
    UNROLL for (int n = 0; n < CHANNELS; n++) color[v][n] = state[v][1 + n];
  }
  int going = 1;
  for (int i = 0; i < length && going;) {
    const int pause = i + PATIENCE < length ? i + PATIENCE : length;
    for (; i < pause; i += AT_ONCE) {
      const int some = pause - i < AT_ONCE ? pause - i : AT_ONCE;
      /* The power, then alpha, then its share of the light. */
      lanes found[AT_ONCE][VECTORS], within[VECTORS];
      Sight s;
      for (int j = 0; j < some; j++) {
        s = see_splat(batch, list[i + j], px, py);
        UNROLL for (int v = 0; v < VECTORS; v++) {
          const lanes power = s.level - s.place * s.place;
          within[v] = place_within(s.place, power, s.peak);
          found[j][v] = power;
          s.place = s.place + s.down;
        }
      }
      for (int j = 0; j < some; j++) {
        const float peak = batch->peak[list[i + j]];
        UNROLL for (int v = 0; v < VECTORS; v++) {
          const lanes power = found[j][v];
          const lanes density = density_of(falloff_of(power, peak), shape_at(&s, within[v]));
          const lanes hidden = hidden_by(density), held = hidden < most ? hidden : most;
          found[j][v] = splat_counts(power, density, peak) ? (ADDITIVE ? density : held) : 0;
        }
      }
#if MEDIAN
      lanes left[VECTORS];
      UNROLL for (int v = 0; v < VECTORS; v++) left[v] = t[v];
#endif
#if !ADDITIVE
      for (int j = 0; j < some; j++) {
        const lanes_int past = batch->order[list[i + j]] + before;
        UNROLL for (int v = 0; v < VECTORS; v++) {
          const lanes share = found[j][v] * t[v], rest = t[v] - share;
#if SMOOTH
          found[j][v] = share;
          t[v] = rest;
#else
          const lanes_int goes_on = rest > TRANSMITTANCE_THRESHOLD;
          found[j][v] = goes_on ? share : 0;
          t[v] = goes_on ? rest : AS_LANES(AS_INT(t[v]) | SIGN_BIT);
          last[v] = goes_on ? past : last[v];
#endif
        }
      }
#endif
      for (int j = 0; j < some; j++) {
        const int k = list[i + j];
        UNROLL for (int v = 0; v < VECTORS; v++)
          UNROLL for (int n = 0; n < SUMS; n++)
            color[v][n] = color[v][n] + found[j][v] * color_seen(batch, &s, k, n, within[v]);
#if MEDIAN
        UNROLL for (int v = 0; v < VECTORS; v++) {
          const lanes_int shown = (found[j][v] > 0) & (left[v] > 0.5f);
          color[v][SUMS] = shown ? color_seen(batch, &s, k, SUMS, within[v]) : color[v][SUMS];
          left[v] = left[v] - found[j][v];
        }
#endif
      }
    }
#if !ADDITIVE && !SMOOTH
    lanes_int sign = AS_INT(t[0]);
    UNROLL for (int v = 1; v < VECTORS; v++) sign &= AS_INT(t[v]);
    going = any_positive(sign);
#endif
  }
  UNROLL for (int v = 0; v < VECTORS; v++) {
    state[v][0] = t[v];
    end[v] = last[v];
    UNROLL for (int n = 0; n < CHANNELS; n++) state[v][1 + n] = color[v][n];
  }
  return going;
}

KERNEL void splat_raster_cpu(
    __global float *restrict image, __global float *restrict transmittance,
    __global int *restrict last, __global const float *restrict packed, MODES_PARAMETER
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts,
    int height, int width, int tiles_x, int first_tile_row, int above, float cap, int stride,
    int first)
{
  const int tile = (int)get_global_id(0), start = starts[tile], stop = starts[tile + 1];
  const Window window = {
      tile % tiles_x * TILE, (tile / tiles_x + first_tile_row) * TILE, width, height};
  const float most = cap_that_counts(cap);
  lanes state[BLOCKS][VECTORS][1 + CHANNELS];
  lanes_int end[BLOCKS][VECTORS];
  Batch batch;
  ushort list[BATCH];
  ulong going = clear_blocks(state, end, window);
  for (int begin = start; begin < stop && going; begin += BATCH) {
    const int count = stop - begin < BATCH ? stop - begin : BATCH;
    stage(&batch, entries + begin, count, window, packed, features, stride, first STAGED_MODES);
    for (int block = 0; block < BLOCKS; block++) {
      if (!(going >> block & 1)) continue;
      const int length = list_block(&batch, block, list);
      if (!draw_block(state[block], end[block], &batch, list, length, block, begin - start + 1, most))
        going &= ~(1ul << block);
    }
  }
  for (int block = 0; block < BLOCKS; block++)
    write_block(
        state[block], end[block], block, window, above, stride, first, stop - start, background, image,
        transmittance, last);
}
