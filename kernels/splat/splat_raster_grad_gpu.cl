/* Gradient of compositing, tile by tile; driver for GPUs.
 *
 * What is computed is told in splat_raster_grad_cpu.cl, blocks and batches in
 * include/raster/group_tile.h. A group works on a tile, part after part, an item on one pixel of a
 * part.
 *
 * What each pixel gives to an entry, RECORD numbers, must be summed over the pixels. Sums over the
 * items of a sub-group take five steps for each number, which costs more than all else (45 exchanges
 * for three channels). But the numbers are moments of two: w = alpha T and g = dL/dsigma (for splats
 * with modes h, see include/raster/hermite_slots.h). So CHUNK entries at a time, those that any
 * block sees:
 *
 *     1. every item, for its pixel, leaves g and w of each entry in local memory;
 *     2. every item, for one entry, one block and one row of the block, reads the g and w of the row
 *        and forms its moments in registers; along a row of a Gaussian dy is the same;
 *     3. the moments go to local memory, and one item for each number of an entry adds what the rows
 *        of the blocks that the entry reaches have of it, in their order.
 *
 * A pair of entry and pixel is so evaluated once, and costs two numbers written and read, however
 * long the record. Nothing needs sub-groups or atomics, any size of a group will do, and the order of
 * all sums is the same in every run. Rows of local memory are one number longer than a block, so that
 * items which read rows side by side find them in different banks.
 *
 * Records of splats with modes may be longer than registers can hold; they are summed in passes.
 * Entries that no block sees before its pixels were finished leave nothing: their `live` stays 0.
 * Where a tile has several parts, a slot is cleared first, and every part adds to it.
 *
 * Index space: (tiles x GROUP), of the rows of tiles from first_tile_row on.
 *
 * Buffers: slots, live[*],
 * grad_image[min(height, (first_tile_row + tiles / tiles_x) * TILE), width, stride], grad_transmittance,
 * transmittance, last[min(height, (first_tile_row + tiles / tiles_x) * TILE), width], packed, modes,
 * features[*], background[stride], entries[*], starts[tiles + 1]. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/raster/alpha.h"
#include "include/raster/hermite_edge.h"
#include "include/raster/hermite_modes.h"
#include "include/raster/hermite_alpha.h"
/* Fewer at a time than compositing has: most of local memory is for the sums. */
#define BATCH (QUADS <= 3 ? 128 : 64)
#include "include/raster/group_tile.h"
#if MODAL
#include "include/raster/hermite_slots.h"
#define MODE_PARAMETERS , __global const float *restrict modes
#else
#include "include/raster/splat_slots.h"
#define MODE_PARAMETERS
#endif
#include "include/raster/group_splat.h"

/* An item sums a row of a block: so many pixels, so many rows of a block, and entries at a time. */
#define SHARE BLOCK_WIDTH
#define SHARES BLOCK_HEIGHT
#define CHUNK SHARE
/* A row of local memory: one number of an entry and a block for each pixel; and how many rows. */
#define PITCH (BLOCK + 1)
#define ROWS (CHUNK * BLOCKS)
/* Numbers that an item sums in one pass over its pixels, as registers hold them; numbers that items
 * then lay down for all to add, for which the memory of the pixels' numbers has room; and passes. */
#define MOST_SUMMED 32
#define ROUND (2 * SHARE)
#define SUMMED (RECORD <= MOST_SUMMED ? RECORD : ROUND)
#define ADDED (SUMMED < ROUND ? SUMMED : ROUND)
#define PASSES ((RECORD + SUMMED - 1) / SUMMED)
/* Numbers that are to stay in registers need loops without turns; too many stay nowhere. */
#if RECORD <= 128
#define UNROLL_IF_FEW UNROLL
#else
#define UNROLL_IF_FEW
#endif
#if MODAL
/* A launch does all channels. */
#define RECORD_LENGTH RECORD
#define PLACE(n) (n)
#define SHARED(n) 1
#endif

/* What the moments of a splat are of: dL/dsigma of a Gaussian, dL/dE weight g of one with modes. */
static float by_density(const Seen *s, float hidden, float alpha, float t, float difference, float most) {
#if MODAL
  float h = hidden <= most ? s->exponential * (t * difference) : 0;
  if (ACTIVATION != CLAMP) h *= 1.0f - hidden;
  return SQUARED ? h * s->shaped : h;
#else
  return !SMOOTH && hidden > most ? 0 : -(alpha * t) * difference;
#endif
}

#if MODAL

/* Add one pixel to the numbers from `pass` on of the moments of include/raster/hermite_slots.h. */
static void add_pixel(
    float *sums, int pass, const float *splat, float x, float y, float h, float w, __local const float *view)
{
  const float dx = x - splat[SPLAT_X], dy = y - splat[SPLAT_Y];
  const float u1 = splat[SPLAT_FAR] * dx / STRETCH;
  const float u2 = (splat[SPLAT_LEAN] * dx + splat[SPLAT_RISE] * dy) / STRETCH;
  /* Far away h and w are zero, and powers may be too large for a float. */
  const int within = u1 * u1 + u2 * u2 <= REACH * REACH;
  float he1[MOMENT_ORDER + 1], he2[MOMENT_ORDER + 1];
  hermite_values(he1, within ? u1 : 0, MOMENT_ORDER);
  hermite_values(he2, within ? u2 : 0, MOMENT_ORDER);
  UNROLL_IF_FEW for (int j = 0; j < SHAPE_ORDER + 3; j++)
    UNROLL_IF_FEW for (int i = 0; i < SHAPE_ORDER + 3; i++) {
      const int n = MODE(i, j) - pass;
      if (i + j < SHAPE_ORDER + 3 && n >= 0 && n < SUMMED) sums[n] += h * he2[j] * he1[i];
    }
  UNROLL_IF_FEW for (int c = 0; c < CHANNELS; c++)
    UNROLL_IF_FEW for (int j = 0; j <= COLOR_ORDER; j++)
      UNROLL_IF_FEW for (int i = 0; i <= COLOR_ORDER; i++) {
        const int n = COLOR_MOMENT(i, j, c) - pass;
        if (i + j <= (c < VARIED ? COLOR_ORDER : 0) && n >= 0 && n < SUMMED)
          sums[n] += w * view[c * BLOCKS * PITCH] * he2[j] * he1[i];
      }
}

#else

/* Sum a row of pixels, the first of which has its centre at (x, y): the record of
 * include/raster/splat_slots.h. Along a row dy is the same, so that moments in dy follow from
 * sums. */
static void sum_row(
    float *sums, const float *splat, float x, float y, __local const float *g_of, __local const float *w_of,
    __local const float *view)
{
  const float first_dx = splat[SPLAT_X] - x, dy = splat[SPLAT_Y] - y;
  float zeroth = 0, first_x = 0;
  UNROLL for (int n = 0; n < RECORD; n++) sums[n] = 0;
  /* Two at a time: the whole row at once takes more registers than it saves time. */
  _Pragma("unroll 2") for (int i = 0; i < SHARE; i++) {
    const float dx = first_dx - i, w = w_of[i];
    float g = g_of[i];
#if SMOOTH || ABSGRAD
    const float far = splat[SPLAT_FAR] * dx, near = splat[SPLAT_LEAN] * dx + splat[SPLAT_RISE] * dy;
#endif
#if SMOOTH
    sums[0] += g;
    g *= falloff_rate(-(far * far + near * near));
#endif
    const float gx = g * dx;
    zeroth += g;
    first_x += gx;
    sums[3] += gx * dx;
    UNROLL for (int n = 0; n < CHANNELS; n++) sums[6 + n] += w * view[n * BLOCKS * PITCH + i];
#if ABSGRAD
    sums[RECORD - 2] += fabs(g * (splat[SPLAT_FAR] * far + splat[SPLAT_LEAN] * near)) * (1 / (STRETCH * STRETCH));
    sums[RECORD - 1] += fabs(g * (splat[SPLAT_RISE] * near)) * (1 / (STRETCH * STRETCH));
#endif
  }
#if !SMOOTH
  sums[0] = zeroth;
#endif
  sums[1] = first_x;
  sums[2] = zeroth * dy;
  sums[4] = first_x * dy;
  sums[5] = zeroth * dy * dy;
}

#endif

KERNEL void splat_raster_grad_gpu(
    __global float *restrict slots, __global uchar *restrict live, __global const float *restrict grad_image,
    __global const float *restrict grad_transmittance, __global const float *restrict transmittance,
    __global const int *restrict last, __global const float *restrict packed,
    __global const float *restrict features, __global const float *restrict background,
    __global const int2 *restrict entries, __global const int *restrict starts, int height, int width,
    int tiles_x, int first_tile_row, int tiles, float cap, int stride, int first MODE_PARAMETERS)
{
  __local float4 staged[QUADS * BATCH];
  __local uchar reached[BATCH] __attribute__((aligned(4)));
  __local uchar order[BATCH];
  __local int slot_of[BATCH];
  __local uint seen_words[WORDS];
  __local float shares[2 * ROWS * PITCH], views[CHANNELS * BLOCKS * PITCH];
#if PASSES > 1
  /* A further pass wants the pixels' numbers again. */
  __local float totals[ROUND * (GROUP + 1)];
#else
  __local float *totals = shares;
#endif
  __local int block_ends[BLOCKS], seen_count[1];
  const int me = (int)get_local_id(0), tile = GROUP_NUMBER(0);
  if (tile >= tiles) return;
  const int block = me / BLOCK, at = block * PITCH + me % BLOCK;
  /* Of the second step: the entry, its block, and the first of the pixels. */
  const int of_entry = me / (BLOCKS * SHARES), of_block = me / SHARES % BLOCKS, from = me % SHARES * SHARE;
  const int start = starts[tile], stop = starts[tile + 1];
  const float most = cap_that_counts(cap);
#if PARTS > 1
  /* Every part adds to what is there. */
  for (int n = me; n < (stop - start) * RECORD; n += GROUP)
    if (first == 0 || !SHARED(n % RECORD))
      slots[(long)entries[start + n / RECORD].y * RECORD_LENGTH + PLACE(n % RECORD)] = 0;
  barrier(CLK_GLOBAL_MEM_FENCE);
#endif
  for (int part = 0; part < PARTS; part++) {
    const int corner = part * GROUP, column = COLUMN_OF(me), row = ROW_OF(me);
    const int x0 = tile % tiles_x * TILE + COLUMN_OF(corner);
    const int y0 = (tile / tiles_x + first_tile_row) * TILE + ROW_OF(corner);
    const int inside = x0 + column < width && y0 + row < height;
    const long pixel = inside ? (long)(y0 + row) * width + x0 + column : 0;
    const int end = inside ? last[pixel] + start : start;
    float left = inside ? transmittance[pixel] : 1, behind = inside ? grad_transmittance[pixel] : 0;
    float view[CHANNELS];
    UNROLL for (int n = 0; n < CHANNELS; n++) {
      view[n] = inside ? grad_image[pixel * stride + first + n] : 0;
      views[n * BLOCKS * PITCH + at] = view[n];
    }
    /* Apart: clspv dies where this stands in the loop above. */
    UNROLL for (int n = 0; n < CHANNELS; n++) behind += view[n] * background[first + n];
    /* Ends lie for a moment where sums will. */
    shares[me] = as_float(end);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (me < BLOCKS) {
      int latest = start;
      for (int n = 0; n < BLOCK; n++) {
        const int other = as_int(shares[me * BLOCK + n]);
        latest = other > latest ? other : latest;
      }
      block_ends[me] = latest;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    int deepest = start;
    UNROLL for (int b = 0; b < BLOCKS; b++) deepest = block_ends[b] > deepest ? block_ends[b] : deepest;
    for (int top = deepest; top > start; top -= BATCH) {
      /* Place k of a batch is entry top - 1 - k: the list is walked from its end. */
      for (int k = me; k < BATCH; k += GROUP) {
        const int entry = top - 1 - k;
        uint blocks = 0;
        if (entry >= start) {
          const int2 pair = entries[entry];
          blocks = fetch_splat(staged, k, pair.x, x0, y0, packed, features, stride, first);
          UNROLL for (int b = 0; b < BLOCKS; b++) blocks &= entry < block_ends[b] ? ~0u : ~(1u << b);
          slot_of[k] = pair.y;
          if (blocks) live[pair.y] = 1;
        }
        reached[k] = (uchar)blocks;
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      for (int w = me; w < WORDS; w += GROUP)
        seen_words[w] = any_of_bytes((__local const uint *)reached + 8 * w);
      barrier(CLK_LOCAL_MEM_FENCE);
      for (int k = me; k < BATCH; k += GROUP) {
        int before = popcount(seen_words[k / 32] & ((1u << k % 32) - 1));
        for (int w = 0; w < k / 32; w++) before += popcount(seen_words[w]);
        if (reached[k]) order[before] = (uchar)k;
      }
      if (me == 0) {
        int sum = 0;
        for (int w = 0; w < WORDS; w++) sum += popcount(seen_words[w]);
        seen_count[0] = sum;
      }
      barrier(CLK_LOCAL_MEM_FENCE);
      const int count = seen_count[0];
      for (int begin = 0; begin < count; begin += CHUNK) {
        ROLLED for (int e = 0; e < CHUNK && begin + e < count; e++) {
          const int k = order[begin + e], entry = top - 1 - k, place = e * BLOCKS * PITCH + at;
          if (!(reached[k] >> block & 1)) continue;
          float splat[4 * QUADS];
          read_splat(splat, staged, k);
          const Seen seen = see(splat, column + 0.5f, row + 0.5f AND_MODES);
          float g = 0, w = 0;
          if (seen.density != 0 && entry < end) {
            float cv = 0;
            UNROLL_IF_FEW for (int n = 0; n < CHANNELS; n++)
              cv += view[n] * color_seen(&seen, splat, n AND_MODES);
#if ADDITIVE
            w = seen.density;
            g = MODAL ? seen.exponential * cv : -w * cv;
#else
            const float hidden = hidden_by(seen.density), alpha = capped(hidden, most);
            const float t = left / (1.0f - alpha), difference = cv - behind;
            left = t;
            behind += alpha * difference;
            w = alpha * t;
            g = by_density(&seen, hidden, alpha, t, difference, most);
#endif
          }
          shares[place] = g;
          shares[ROWS * PITCH + place] = w;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        /* Items whose entry does not reach their block sum what nobody reads: there is no branch
         * round a barrier, which compilers may follow with another. */
        const int k = begin + of_entry < count ? order[begin + of_entry] : 0;
        const int place = (of_entry * BLOCKS + of_block) * PITCH + from;
        const int number = of_block * BLOCK + from;
        const float x = COLUMN_OF(number) + 0.5f, y = ROW_OF(number) + 0.5f;
        __local const float *g_of = shares + place, *w_of = g_of + ROWS * PITCH;
        __local const float *view_of = views + of_block * PITCH + from;
        float splat[4 * QUADS];
        read_splat(splat, staged, k);
        UNROLL_IF_FEW for (int pass = 0; pass < RECORD; pass += SUMMED) {
          float sums[SUMMED];
#if MODAL
          UNROLL for (int n = 0; n < SUMMED; n++) sums[n] = 0;
          ROLLED for (int i = 0; i < SHARE; i++)
            add_pixel(sums, pass, splat, x + i, y, g_of[i], w_of[i], view_of + i);
#else
          sum_row(sums, splat, x, y, g_of, w_of, view_of);
#endif
          UNROLL_IF_FEW for (int round = 0; round < SUMMED; round += ROUND) {
            /* What was read last from where the sums go is read. */
            barrier(CLK_LOCAL_MEM_FENCE);
            UNROLL for (int n = 0; n < ROUND && round + n < SUMMED; n++)
              totals[n * (GROUP + 1) + me] = sums[round + n];
            barrier(CLK_LOCAL_MEM_FENCE);
            for (int n = me; n < ADDED * CHUNK; n += GROUP) {
              const int e = n / ADDED, in_round = n % ADDED, number_of = pass + round + in_round;
              if (begin + e >= count || number_of >= RECORD) continue;
              const int added = order[begin + e];
              float sum = 0;
              for (uint blocks = reached[added]; blocks; blocks &= blocks - 1) {
                const int items = in_round * (GROUP + 1) + (e * BLOCKS + lowest_bit(blocks)) * SHARES;
                UNROLL for (int i = 0; i < SHARES; i++) sum += totals[items + i];
              }
              __global float *slot = slots + (long)slot_of[added] * RECORD_LENGTH + PLACE(number_of);
              *slot = PARTS > 1 || (first > 0 && SHARED(number_of)) ? *slot + sum : sum;
            }
          }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
      }
    }
    if (PARTS > 1) barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
  }
}
