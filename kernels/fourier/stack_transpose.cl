/* Exchange the first and the last axis of a stack, which turns views into detector columns and back.
 *
 *     out[j * out_pitch + slice * out_slice + i] = source[i * in_pitch + slice * in_slice + j]
 *
 * A column, which is what one detector bin saw in all views, is contiguous afterwards: sorting it
 * from a stack of projections would touch another page of memory for every view.
 *
 * Index space: (strips of STRIP j, strips of STRIP i, slices), in groups of GROUP along the first.
 * A CPU moves blocks of LANES x LANES through registers; a group of a GPU moves a tile of
 * GROUP x DEEP through local memory, so that it reads and writes runs of neighbours.
 *
 * Buffers: source[(along2 - 1) * in_slice + (ni - 1) * in_pitch + nj],
 * out[(along2 - 1) * out_slice + (nj - 1) * out_pitch + ni]. */

#include "include/portable.h"
#include "include/transpose.h"

#ifndef STRIP
#define STRIP 64
#endif
#ifndef DEEP
#define DEEP 16
#endif

KERNEL void stack_transpose(
    __global const float *restrict source, __global float *restrict out,
    int ni, int nj, long in_pitch, long in_slice, long out_pitch, long out_slice)
{
  source += get_global_id(2) * in_slice;
  out += get_global_id(2) * out_slice;
#if LANES == 8
  const int j0 = (int)get_global_id(0) * STRIP, i0 = (int)get_global_id(1) * STRIP;
  const int j1 = j0 + STRIP < nj ? j0 + STRIP : nj, i1 = i0 + STRIP < ni ? i0 + STRIP : ni;
  for (int i = i0; i < i1; i += LANES)
    for (int j = j0; j < j1; j += LANES) {
      if (i + LANES <= i1 && j + LANES <= j1) {
        lanes block[LANES];
        UNROLL for (int k = 0; k < LANES; k++) block[k] = LOAD(source + (i + k) * in_pitch + j);
        TRANSPOSE(block)
        UNROLL for (int k = 0; k < LANES; k++) STORE(out + (j + k) * out_pitch + i, block[k]);
        continue;
      }
      for (int k = i; k < i1 && k < i + LANES; k++)
        for (int l = j; l < j1 && l < j + LANES; l++) out[l * out_pitch + k] = source[k * in_pitch + l];
    }
#else
  __local float tile[DEEP * (GROUP + 1)];
  const int local_j = (int)get_local_id(0);
  const int j0 = GROUP_NUMBER(0) * GROUP, i0 = (int)get_global_id(1) * DEEP;
  for (int k = 0; k < DEEP; k++)
    if (i0 + k < ni && j0 + local_j < nj)
      tile[k * (GROUP + 1) + local_j] = source[(i0 + k) * in_pitch + j0 + local_j];
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int number = local_j; number < DEEP * GROUP; number += GROUP) {
    const int i = number % DEEP, j = number / DEEP;
    if (i0 + i < ni && j0 + j < nj)
      out[(j0 + j) * out_pitch + i0 + i] = tile[i * (GROUP + 1) + j];
  }
#endif
}
