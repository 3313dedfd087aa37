/* Transforms of pairs of views become rays of the spectrum: the pairs are told apart, turned and
 * weighted (see include/ray_response.h).
 *
 * With Z the transform of a + i b, a real view has the transform (Z[l] + conj Z[-l]) / 2 and its
 * partner (Z[l] - conj Z[-l]) / 2i, both of period `length`. Rays that point to the left are
 * reflected, which makes them their conjugates: `signs` is -1 for them. Samples 0 .. ends - 1 of a
 * ray are made, which may be more than a period, and perhaps some behind them; rows of samples are a
 * multiple of LANES.
 *
 * Index space: (blocks of LANES columns, runs of RUN samples, parts). */

#include "include/portable.h"
#include "include/transpose.h"
#include "include/turn.h"
#include "include/ray_response.h"

#ifndef RUN
#define RUN (LANES == 8 ? 256 : 1)
#endif

KERNEL void rays_weigh(
    __global const float *restrict fields, __global float *restrict rays,
    __global const uint *restrict turns, __global const float *restrict half_shadows,
    __global const float *restrict signs, __global const int *restrict ends, int count, int samples, int length, int columns)
{
  const int c = (int)get_global_id(0) * LANES, part = (int)get_global_id(2);
  if (c >= columns) return;
  const int begin = (int)get_global_id(1) * RUN;
  const int ray0 = part * columns + c;
  int end = 0;
  for (int k = 0; k < LANES && ray0 + k < count; k++) end = ends[ray0 + k] > end ? ends[ray0 + k] : end;
  if (begin + RUN < end) end = begin + RUN;
  const lanes_whole turn = LOAD_WHOLE(turns + ray0);
  const lanes half_shadow = LOAD(half_shadows + ray0), sign = LOAD(signs + ray0);
  __global const float *zr = fields + c, *zi = zr + (long)length * columns;
  for (int l0 = begin; l0 < end; l0 += LANES) {
    lanes re[LANES], im[LANES];
    UNROLL for (int k = 0; k < LANES; k++) {
      const int l = (l0 + k) % length, m = l > 0 ? length - l : 0;
      const lanes ar = LOAD(zr + (long)l * columns), ai = LOAD(zi + (long)l * columns);
      const lanes br = LOAD(zr + (long)m * columns), bi = LOAD(zi + (long)m * columns);
      const lanes qr = part ? ai + bi : ar + br, qi = part ? br - ar : ai - bi;
      const response w = ray_response(l0 + k, turn, half_shadow);
      re[k] = 0.5f * (qr * w.real - qi * w.imaginary);
      im[k] = 0.5f * sign * (qr * w.imaginary + qi * w.real);
    }
    TRANSPOSE(re)
    TRANSPOSE(im)
    UNROLL for (int k = 0; k < LANES; k++) {
      if (ray0 + k >= count) continue;
      __global float *out = rays + (long)(ray0 + k) * samples + l0;
      STORE(out, re[k]);
      STORE(out + (long)count * samples, im[k]);
    }
  }
}
