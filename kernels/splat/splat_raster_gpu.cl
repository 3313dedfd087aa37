/* Composite the splats of a tile front to back; driver for GPUs.
 *
 * What is computed is told in splat_raster_cpu.cl. A group draws a part of a tile, an item one pixel
 * (include/raster/group_tile.h). The tile's list comes in batches of BATCH entries: every item
 * fetches some into local memory, so that the three loads which wait for each other, entry, record
 * and features, are waited for once a batch and not once an entry, and says which blocks each of
 * them reaches. Eight bytes of such bits at a time become words of 32 entries for each block, and
 * an item walks the words of its block alone. An item whose pixel is finished leaves the walk; a
 * sub-group goes on when its last item left, and the group ends before the batch that no pixel
 * waits for.
 *
 * Written for each pixel: the image's CHANNELS numbers from `first` on of `stride`, the final
 * transmittance, and one past the last entry of the tile's that it saw. These arrays begin with row
 * `above` of the image.
 *
 * Index space: (pixels), tile after tile of the rows of tiles from first_tile_row on, in tiles part
 * after part.
 *
 * Buffers: image[min(height, (first_tile_row + tiles / tiles_x) * TILE) - above, width, stride],
 * transmittance, last[min(height, (first_tile_row + tiles / tiles_x) * TILE) - above, width], packed, modes,
 * features[*], background[stride], entries[*], starts[tiles + 1]. */

#include "include/portable.h"
#include "include/exponential.h"
#include "include/raster/alpha.h"
#include "include/raster/hermite_edge.h"
#include "include/raster/hermite_modes.h"
#include "include/raster/hermite_alpha.h"
#include "include/raster/group_tile.h"
#if MODAL
#define MODE_PARAMETERS , __global const float *restrict modes
#else
#define MODE_PARAMETERS
#endif
#include "include/raster/group_splat.h"

KERNEL void splat_raster_gpu(
    __global float *restrict image, __global float *restrict transmittance, __global int *restrict last,
    __global const float *restrict packed, __global const float *restrict features,
    __global const float *restrict background, __global const int2 *restrict entries,
    __global const int *restrict starts, int height, int width, int tiles_x, int first_tile_row, int above,
    int tiles, float cap, int stride, int first MODE_PARAMETERS)
{
  __local float4 staged[QUADS * BATCH];
  __local uchar reached[BATCH] __attribute__((aligned(4)));
  __local uint words[BLOCKS][WORDS];
  /* Whether any pixel waits for a batch; two, so that the next is cleared while this one is read. */
  __local int waiting[2];
  const int me = (int)get_local_id(0), part = GROUP_NUMBER(0), tile = part / PARTS;
  if (tile >= tiles) return;
  const int corner = part % PARTS * GROUP;
  const int x0 = tile % tiles_x * TILE + COLUMN_OF(corner);
  const int y0 = (tile / tiles_x + first_tile_row) * TILE + ROW_OF(corner);
  const int column = COLUMN_OF(me), row = ROW_OF(me), inside = x0 + column < width && y0 + row < height;
  const int start = starts[tile], stop = starts[tile + 1];
  const float most = cap_that_counts(cap), x = column + 0.5f, y = row + 0.5f;
  float left = 1, color[CHANNELS];
  int end = start, finished = !inside;
  UNROLL for (int n = 0; n < CHANNELS; n++) color[n] = 0;
  if (me < 2) waiting[me] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int begin = start, turn = 0; begin < stop; begin += BATCH, turn ^= 1) {
    if (!finished) waiting[turn] = 1;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!waiting[turn]) break;
    if (me == 0) waiting[turn ^ 1] = 0;
    for (int k = me; k < BATCH; k += GROUP) {
      const int entry = begin + k;
      reached[k] = entry < stop
          ? fetch_splat(staged, k, entries[entry].x, x0, y0, packed, features, stride, first) : 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int n = me; n < BLOCKS * WORDS; n += GROUP)
      words[n / WORDS][n % WORDS] = bit_of_bytes((__local const uint *)reached + n % WORDS * 8, n / WORDS);
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int w = 0; w < WORDS && !finished; w++)
      for (uint word = words[me / BLOCK][w]; word; word &= word - 1) {
        const int k = 32 * w + lowest_bit(word);
        float splat[4 * QUADS];
        read_splat(splat, staged, k);
        const Seen seen = see(splat, x, y AND_MODES);
        const float before = left;
        float share = seen.density;
#if !ADDITIVE
        const float hidden = hidden_by(seen.density);
        share = capped(hidden, most) * left;
        if (!SMOOTH && left - share <= TRANSMITTANCE_THRESHOLD) {
          finished = 1;
          break;
        }
        left -= share;
#endif
        if (share == 0) continue;
        end = begin + k + 1;
        UNROLL for (int n = 0; n < SUMS; n++) color[n] += share * color_seen(&seen, splat, n AND_MODES);
#if MEDIAN
        if (before > 0.5f) color[SUMS] = color_seen(&seen, splat, SUMS AND_MODES);
#endif
      }
  }
  if (!inside) return;
  const long pixel = (long)(y0 + row - above) * width + x0 + column;
  transmittance[pixel] = left;
  last[pixel] = end - start;
  UNROLL for (int n = 0; n < CHANNELS; n++)
    image[pixel * stride + first + n] = color[n] + (ADDITIVE ? 0 : left * background[first + n]);
}
