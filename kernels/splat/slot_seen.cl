/* Mark the slots of (splat, tile) pairs that a gradient looks at.
 *
 *     seen[slot] = 1 for the entries of a tile that come before all its pixels were left behind
 *
 * `last` is what the rasterizer kept of each pixel: how many of its tile's entries the gradient looks
 * at. Index space: tiles.
 *
 * Buffers: entries[*], starts[tiles], last[min(height, (first_tile_row + tiles / tiles_x) * TILE), width],
 * seen[*]. */

#include "include/portable.h"

#ifndef TILE
#define TILE 16
#endif

KERNEL void slot_seen(
    __global const int2 *restrict entries, __global const int *restrict starts,
    __global const int *restrict last, __global int *restrict seen, int height, int width,
    int tiles_x, int first_tile_row, int tiles)
{
  const int tile = (int)get_global_id(0);
  if (tile >= tiles) return;
  const int x0 = tile % tiles_x * TILE, y0 = (tile / tiles_x + first_tile_row) * TILE;
  const int x1 = x0 + TILE < width ? x0 + TILE : width, y1 = y0 + TILE < height ? y0 + TILE : height;
  int deepest = 0;
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++) {
      const int end = last[(long)y * width + x];
      deepest = end > deepest ? end : deepest;
    }
  for (int k = 0; k < deepest; k++) seen[entries[starts[tile] + k].y] = 1;
}
