/* Where each chunk's entries begin within a tile, and how many entries a tile has.
 *
 *     table[chunk][tile] = entries that the chunks before have in this tile
 *     counts[tile]       = entries of the tile;  counts[tiles] = 0
 *
 * Index space: runs of `run` tiles; a run is done chunk after chunk, which reads whole rows.
 * Where one run is all there is (WHOLE 1), counts become the sums of those before.
 *
 * Buffers: table[chunks, tiles], counts[tiles + 1]. */

#include "include/portable.h"

#ifndef WHOLE
#define WHOLE 0
#endif

KERNEL void tile_offsets(
    __global int *restrict table, __global int *restrict counts, int chunks, int tiles, int run)
{
  const int first = (int)get_global_id(0) * run;
  if (first >= tiles) return;
  const int stop = run < tiles - first ? first + run : tiles;
  for (int tile = first; tile < stop; tile++) counts[tile] = 0;
  for (int chunk = 0; chunk < chunks; chunk++) {
    __global int *row = table + (long)chunk * tiles;
    for (int tile = first; tile < stop; tile++) {
      const int count = row[tile];
      row[tile] = counts[tile];
      counts[tile] += count;
    }
  }
  int sum = 0;
  for (int tile = first; WHOLE && tile < stop; tile++) {
    const int count = counts[tile];
    counts[tile] = sum;
    sum += count;
  }
  if (first == 0) counts[tiles] = sum;
}
