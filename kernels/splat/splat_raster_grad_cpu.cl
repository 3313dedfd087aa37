/* Gradient of compositing, tile by tile; driver for CPUs.
 *
 * With v = dL/dC and u = dL/d(final transmittance) of a pixel, whose last entry is known from the
 * way forward, go back to front. Let q be the colour that lies behind a splat, seen through v:
 * q = v . background + u behind the last one, then q' = alpha (c . v) + (1 - alpha) q. So
 *
 *     T = T' / (1 - alpha),    dL/dalpha = T (c . v - q),    dL/dc = alpha T v,
 *     dL/dE = dL/dalpha dalpha/dE,  zero where E does not count or alpha is capped.
 *
 * No sum is ever taken back, so the deepest splats keep their digits. A forward sweep would need
 * what remains of C after each splat, a difference of nearly equal numbers.
 *
 * Tiles, batches and lists of blocks are those of splat_raster_cpu.cl, the lists gone through from
 * the back. What the pixels of a block give to a splat's sums stays in lanes: each entry of a batch
 * has its vectors, to which all blocks add in turn, and once per entry they become numbers. Each
 * (splat, tile) pair owns a slot (include/raster/splat_slots.h, include/raster/hermite_slots.h),
 * which is written once, in a fixed order of sums; a pair that touches no pixel, or lies behind all
 * that is seen, writes nothing: `live` says which slots hold something, and is zero before.
 *
 * Index space: (tiles), of the rows of tiles from first_tile_row on.
 *
 * Buffers: slots, live[*],
 * grad_image[min(height, (first_tile_row + along0 / tiles_x) * TILE), width, stride], grad_transmittance,
 * transmittance, last[min(height, (first_tile_row + along0 / tiles_x) * TILE), width], packed, modes,
 * features[*], background[stride], entries[*], starts[along0 + 1]. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/raster/alpha.h"
#include "include/raster/screen_record.h"
#include "include/transpose.h"
#include "include/raster/hermite_edge.h"
#include "include/raster/hermite_modes.h"
#include "include/raster/hermite_alpha.h"
#if MODAL
#include "include/raster/hermite_slots.h"
#define HE_ORDER MOMENT_ORDER
#else
#include "include/raster/splat_slots.h"
#endif
#include "include/raster/pixel_blocks.h"
#include "include/raster/block_lists.h"
#include "include/raster/block_splat.h"
#if MODAL
#include "include/raster/hermite_moments.h"
#else
#include "include/raster/gaussian_moments.h"
#endif

/* Splats that go together from step to step of the way back, as in splat_raster_cpu.cl. */
#define AT_ONCE (MODAL ? 1 : 8)

/* Of each pixel: T on the way back, q, and v. */
typedef lanes Pixels[VECTORS][2 + CHANNELS];

/* Read a block's pixels; where the deepest of them was left is returned. */
static int read_block(
    Pixels state, lanes_int *end, int block, Window window, int stride, int first,
    __global const float *background, __global const float *grad_image,
    __global const float *grad_transmittance, __global const float *transmittance,
    __global const int *last)
{
  UNROLL for (int v = 0; v < VECTORS; v++) {
    state[v][0] = 1;
    UNROLL for (int n = 0; n <= CHANNELS; n++) state[v][1 + n] = 0;
    end[v] = 0;
  }
  const Rows rows = rows_of(window, block);
  int deepest = 0;
  for (int row = 0; row < rows.down; row++) {
    const long pixel = rows.first + (long)row * window.width;
    float *numbers = (float *)state[row / 2] + row % 2 * 4;
    int *ends = (int *)&end[row / 2] + row % 2 * 4;
    for (int k = 0; k < rows.across; k++) {
      float q = grad_transmittance[pixel + k];
      UNROLL for (int n = 0; n < CHANNELS; n++) {
        const float g = grad_image[(pixel + k) * stride + first + n];
        numbers[8 * (2 + n) + k] = g;
        q += g * background[first + n];
      }
      numbers[k] = transmittance[pixel + k];
      numbers[8 + k] = q;
      ends[k] = last[pixel + k];
      deepest = ends[k] > deepest ? ends[k] : deepest;
    }
  }
  return deepest;
}

/* Go back through a block's list, and add to the sums of each of its entries. `begin` of the
 * tile's entries lie before the batch. */
static void undo_block(
    Pixels state, const lanes_int *end, const Batch *batch, const ushort *list, int length, int block,
    int begin, float most, lanes (*sums)[SUMS])
{
  const lanes px = block_x(block), py = block_y(block);
  lanes t[VECTORS], q[VECTORS], view[VECTORS][CHANNELS];
  lanes_int until[VECTORS];
  UNROLL for (int v = 0; v < VECTORS; v++) {
    t[v] = state[v][0];
    q[v] = state[v][1];
    until[v] = end[v] - begin;
    UNROLL for (int n = 0; n < CHANNELS; n++) view[v][n] = state[v][2 + n];
  }
  for (int i = length - 1; i >= 0; i -= AT_ONCE) {
    const int some = i < AT_ONCE ? i + 1 : AT_ONCE;
    /* The power, then alpha before the cap, then w; c . v, then h. */
    lanes weight[AT_ONCE][VECTORS], value[AT_ONCE][VECTORS], lever[VECTORS], within[VECTORS], top = 0;
    Sight s;
    for (int j = 0; j < some; j++) {
      s = see_splat(batch, list[i - j], px, py);
      top = s.place;
      UNROLL for (int v = 0; v < VECTORS; v++) {
        const lanes power = s.level - s.place * s.place;
        within[v] = place_within(s.place, power, s.peak);
        weight[j][v] = power;
        s.place = s.place + s.down;
      }
    }
    for (int j = 0; j < some; j++) {
      const lanes_int order = batch->order[list[i - j]];
      const float peak = batch->peak[list[i - j]];
      UNROLL for (int v = 0; v < VECTORS; v++) {
        const lanes power = weight[j][v], shaped = shape_at(&s, within[v]), g = falloff_of(power, peak);
        const lanes density = density_of(g, shaped);
        lanes_int counts = splat_counts(power, density, peak);
#if ADDITIVE
        weight[j][v] = counts ? density : 0;
        lever[v] = counts ? g : 0;
#else
        if (!SMOOTH) counts = counts & (order < until[v]);
        const lanes hidden = hidden_by(density);
        weight[j][v] = counts ? hidden : 0;
        /* dE/dQ dalpha/dE, or half of it where the square of Q counts; far from the splat no number. */
        lanes rate = g;
        if (ACTIVATION != CLAMP) rate = rate * (1.0f - hidden);
        if (SQUARED) rate = rate * shaped;
        lever[v] = (counts & (hidden <= most)) ? rate : 0;
#endif
      }
    }
    for (int j = 0; j < some; j++) {
      const int k = list[i - j];
      UNROLL for (int v = 0; v < VECTORS; v++) {
        value[j][v] = 0;
        UNROLL for (int n = 0; n < CHANNELS; n++)
          value[j][v] = value[j][v] + color_seen(batch, &s, k, n, within[v]) * view[v][n];
      }
    }
    for (int j = 0; j < some; j++) {
      UNROLL for (int v = 0; v < VECTORS; v++) {
#if ADDITIVE
        value[j][v] = (SHAPE_ORDER == 0 ? weight[j][v] : lever[v]) * value[j][v];
#else
        const lanes hidden = weight[j][v], difference = value[j][v] - q[v];
        const lanes alpha = hidden < most ? hidden : most;
        t[v] = t[v] / (1.0f - alpha);
        weight[j][v] = alpha * t[v];
        q[v] = q[v] + alpha * difference;
#if SHAPE_ORDER == 0 && ACTIVATION == CLAMP
        value[j][v] = hidden > most ? 0 : weight[j][v] * difference;
#else
        value[j][v] = lever[v] * (t[v] * difference);
#endif
#endif
      }
    }
    for (int j = 0; j < some; j++) {
      const int k = list[i - j];
      if (MODAL) s.place = top;
      else s = see_splat(batch, k, px, py);
      BlockSums found;
      clear_sums(&found);
      UNROLL for (int v = 0; v < VECTORS; v++) {
        const lanes power = s.level - s.place * s.place;
        add_pixels(&found, v, value[j][v], weight[j][v], view[v], &s, batch, k, power, within[v]);
        s.place = s.place + s.down;
      }
      add_block(sums[k], &found, &s);
    }
  }
  UNROLL for (int v = 0; v < VECTORS; v++) {
    state[v][0] = t[v];
    state[v][1] = q[v];
  }
}

KERNEL void splat_raster_grad_cpu(
    __global float *restrict slots, __global uchar *restrict live,
    __global const float *restrict grad_image, __global const float *restrict grad_transmittance,
    __global const float *restrict transmittance, __global const int *restrict last,
    __global const float *restrict packed, MODES_PARAMETER __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row,
    float cap, int stride, int first)
{
  const int tile = (int)get_global_id(0), start = starts[tile];
  const Window window = {
      tile % tiles_x * TILE, (tile / tiles_x + first_tile_row) * TILE, width, height};
  const float most = cap_that_counts(cap);
  Pixels state[BLOCKS];
  lanes_int end[BLOCKS][VECTORS];
  lanes sums[BATCH][SUMS];
  Batch batch;
  ushort list[BATCH];
  int ends[BLOCKS], deepest = 0;
  for (int block = 0; block < BLOCKS; block++) {
    ends[block] = read_block(
        state[block], end[block], block, window, stride, first, background, grad_image,
        grad_transmittance, transmittance, last);
    deepest = ends[block] > deepest ? ends[block] : deepest;
  }
  for (int top = deepest; top > 0; top -= BATCH) {
    const int begin = top > BATCH ? top - BATCH : 0, count = top - begin, places = (count + 7) / 8 * 8;
    __global const int2 *here = entries + start + begin;
    stage(&batch, here, count, window, packed, features, stride, first STAGED_MODES);
    for (int k = 0; k < places; k++)
      UNROLL for (int n = 0; n < SUMS; n++) sums[k][n] = 0;
    for (int block = 0; block < BLOCKS; block++) {
      if (ends[block] <= begin) continue;
      int length = list_block(&batch, block, list);
      while (length > 0 && batch.order[list[length - 1]] >= ends[block] - begin) length--;
      undo_block(state[block], end[block], &batch, list, length, block, begin, most, sums);
    }
    for (int k = 0; k < places; k++) {
      if (!batch.touched[k]) continue;
      const long slot = here[batch.order[k]].y;
      write_slot(slots + slot * RECORD_LENGTH, sums[k], stride, first);
      live[slot] = 1;
    }
  }
}
