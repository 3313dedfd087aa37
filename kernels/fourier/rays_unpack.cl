/* Complex columns become views again: the transpose of rays_pack_gpu.
 *
 * Bins that the image's shadow does not reach become zero. Index space: (blocks of LANES columns,
 * runs of RUN rows of the window, parts); the first run and the last also clear what lies before
 * and behind the window.
 *
 * Buffers: fields[along2, length, columns], views[rays, slices, bins], order, starts[rays]. */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/fourier/fourier_rays.h"

#ifndef RUN
#define RUN (LANES == 8 ? 256 : 1)
#endif

KERNEL void rays_unpack(
    __global const float *restrict fields, __global float *restrict views,
    __global const int *restrict order, __global const int *restrict starts,
    int rays, int slice, int slices, int bins, int window, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, part = (int)get_global_id(2);
  if (c >= columns) return;
  const int begin = (int)get_global_id(1) * RUN;
  const int end = begin + RUN < window ? begin + RUN : window;
  __global const float *in = fields + (long)part * length * columns + c;
  for (int r = begin; r < end; r += LANES) {
    lanes block[LANES];
    UNROLL for (int k = 0; k < LANES; k++)
      block[k] = r + k < window ? LOAD(in + (long)(r + k) * columns) : (lanes)0;
    TRANSPOSE(block)
    UNROLL for (int k = 0; k < LANES; k++) {
      const int ray = part * columns + c + k;
      if (ray >= rays) continue;
      const int last = starts[ray] + window < bins ? starts[ray] + window : bins;
      store_between(views + ((long)order[ray] * slices + slice) * bins, starts[ray] + r, last, block[k]);
    }
  }
  for (int k = 0; k < LANES; k++) {
    const int ray = part * columns + c + k;
    if (ray >= rays) continue;
    __global float *view = views + ((long)order[ray] * slices + slice) * bins;
    const int behind = starts[ray] + window;
    if (begin == 0) for (int b = 0; b < starts[ray] && b < bins; b++) view[b] = 0;
    if (end == window) for (int b = behind > 0 ? behind : 0; b < bins; b++) view[b] = 0;
  }
}
