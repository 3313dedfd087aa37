/* An image to the bins of a fan: the transpose of fan_backproject, by gathering.
 *
 *     out[view][bin] = factor[bin] * sum over slabs b of weight(b) *
 *                      sum over pixels i of share(ray, b, i) * plane[b][i]
 *
 * with the weights and shares of include/tomo/fan_footprint.h.
 *
 * A strip's share of a pixel is the difference between its two edges, and all edges but the outer
 * two belong to two bins. Let p[0] be the first pixel that is not wholly before an edge, so that
 * its z - c lies in 0 .. 1, and p[1], p[2] .. those behind it. Of these there is before the edge
 *
 *     E = sum over k >= 0 of p[k] (ramp(z - k) - ramp(z - k - 1))
 *       = p[0] (z - c / 2) + sum over k >= 1 of ramp(z - k) (p[k] - p[k - 1]),
 *
 * where z - k is below c for k >= 1, and below 0 from c + 1 on. A bin has the E of its far edge,
 * less that of its near one, and the pixels from the first of the near one to that of the far one.
 * An item finds the E of each of its edges once and takes differences every ROWS slabs.
 *
 * Index space: (runs of ITEM_BINS bins, views). Each item owns its bins. The plane has `margin` zeros
 * before and after every slab, more than a bin reaches in lines, so that no pixel needs a bounds
 * test; pixels before the first of these are left out.
 *
 * Buffers: sinogram[along1, bins], plane[slabs, lines + 2 * margin], starts, slopes, widths,
 * factors[along1, stride], numbers[along1, VIEW_NUMBERS], views[along1]. */

#include "include/portable.h"
#include "include/tomo/fan_footprint.h"
#include "include/lane_quads.h"

/* Slabs whose first pixels are found together. */
#ifndef ROWS
#define ROWS (LANES == 8 ? 16 : 1)
#endif

/* Slabs that are summed before they are added to the others. Sums of sums round less. */
#define TOGETHER 16

/* Vectors of rays that an item has; items of a projector are counted alike (fan_projector.py).
 * Edges are one more than their bins. A single bin's are a constant number, in registers. */
#if FOOTPRINT == 0
#define VECTORS (LANES == 8 ? 8 : 2)
#define SHARED 1
#else
#define VECTORS 1
#define SHARED 0
#endif
#define ITEM_RAYS (VECTORS * LANES)
#define ITEM_BINS (ITEM_RAYS - SHARED)
#if LANES == 8
#define UNROLL_ONE
#else
#define UNROLL_ONE UNROLL
#endif
/* A row of places: those of an item's rays, and of the one after the last. */
#define PLACES (ITEM_RAYS + LANES)
/* More than rounding moves a place, as a share of it, and in lines. */
#define ASTRAY_SHARE 1.2e-7f
#define ASTRAY 0.01f

#if FOOTPRINT == 0
/* The first pixel that is not wholly before an edge, or where rounding might hide which it is, the
 * one before it. */
static lanes_int first_pixel(lanes place, lanes c, real rho) {
  return floor_int(place * (1 - 2 * ASTRAY_SHARE) - c);
}
#else
/* The first pixel within the hat of a ray. */
static lanes_int first_pixel(lanes place, lanes width, real rho) {
  const lanes near = place - (width > rho ? width / rho : 1.0f);
  return floor_int(near > -2.0f ? near : -2.0f) + 1;
}
#endif

#if FOOTPRINT == 0
static lanes positive(lanes z) { return z > 0 ? z : 0; }

/* The pixels that lie within so many lines, of those from the one before the first line to the one
 * after the last: the others are zeros, and there may be fewer of them than wide bins reach. */
static int pixels_within(real reach, int lines) {
  return reach < (real)lines ? (int)(reach + ASTRAY) + 1 : lines + 1;
}

/* Most pixels between the first ones of edges side by side, in slabs s0 to s1. */
static int most_between(
    lanes low, lanes low_q, lanes high, lanes high_q, real s0, real s1, int lines)
{
  const lanes wider = (high - low) - (slant_of(high_q) - slant_of(low_q)), q = high_q - low_q;
  const real first = largest_lane(wider + s0 * q), last = largest_lane(wider + s1 * q);
  return pixels_within(first > last ? first : last, lines);
}
#endif

KERNEL void fan_project(
    __global real *restrict sinogram, __global const real *restrict plane,
    __global const real *restrict starts, __global const real *restrict slopes,
    __global const real *restrict widths, __global const real *restrict factors,
    __global const real *restrict numbers, __global const int *restrict views, int bins, int stride,
    int slabs, int lines, int margin)
{
  const int r0 = (int)get_global_id(0) * ITEM_BINS, number = (int)get_global_id(1);
  if (r0 >= bins) return;
  const int own = ITEM_BINS > 1 && bins - r0 < ITEM_BINS ? bins - r0 : ITEM_BINS;
  const int vectors = (own + SHARED + LANES - 1) / LANES;
  const long at = (long)number * stride + r0, line_stride = lines + 2 * margin;
  __global const real *view = numbers + (long)number * VIEW_NUMBERS;
  const real middle = (real)0.5f * (slabs - 1), inverse_depth = view[INVERSE_DEPTH];
  real totals[ITEM_RAYS] __attribute__((aligned(sizeof(lanes))));
  real sums[ITEM_RAYS] __attribute__((aligned(sizeof(lanes))));
  int first[ROWS * PLACES] __attribute__((aligned(sizeof(int) * LANES)));
  for (int r = 0; r < own; r++) totals[r] = sums[r] = 0;
  for (int b0 = 0; b0 < slabs; b0 += ROWS) {
    const int rows = ROWS > 1 && b0 + ROWS > slabs ? slabs - b0 : ROWS;
    real depths[ROWS];
    for (int n = 0; n < rows; n++) depths[n] = 1.0f / (1.0f + (b0 + n - middle) * inverse_depth);
    UNROLL_ONE for (int v = 0; v < vectors; v++) {
      const lanes start = LOAD(starts + at + v * LANES), q = LOAD(slopes + at + v * LANES);
#if FOOTPRINT == 0
      const lanes reach = slant_of(q);
#else
      const lanes reach = LOAD(widths + at + v * LANES);
#endif
      for (int n = 0; n < rows; n++) {
        lanes_int i = first_pixel(start + (b0 + n - middle) * q, reach, depths[n]);
        i = i < -1 ? -1 : i;
        i = i > lines ? lines : i;
        KEEP_INTS(first + n * PLACES + v * LANES, i);
      }
    }
#if FOOTPRINT == 0
    /* No bin lies behind the last edge. */
    for (int n = 0; n < rows; n++) {
      int *last = first + n * PLACES + vectors * LANES;
      *last = last[-1];
    }
    real before[ITEM_RAYS] __attribute__((aligned(sizeof(lanes))));
#endif
    UNROLL_ONE for (int v = 0; v < vectors; v++) {
      const long from = at + v * LANES;
      const lanes start = LOAD(starts + from), q = LOAD(slopes + from);
      lanes sum = 0;
#if FOOTPRINT == 0
      const lanes c = slant_of(q), c_half = 0.5f * c, half_inverse = 0.5f / c;
      const int slanted = pixels_within(largest_lane(c), lines);
      const int most = most_between(start, q, LOAD(starts + from + 1), LOAD(slopes + from + 1),
                                    b0 - middle, b0 + rows - 1 - middle, lines);
      lanes edges = 0;
#else
      const lanes width = LOAD(widths + from);
#endif
      for (int n = 0; n < rows; n++) {
        const real s = b0 + n - middle, rho = depths[n];
        __global const real *slab = plane + (b0 + n) * line_stride + margin;
        const int *places = first + n * PLACES + v * LANES;
        const lanes_int i = KEPT_INTS(places);
        lanes z = (start + s * q) - TO_FLOAT(i);
#if FOOTPRINT == 0
        const lanes_int between = NEXT_INTS(places) - i;
        lane_quad p = quads_at(slab, places);
        const lanes next = z - 1.0f, slope = clamped(next, c);
        const lanes next_ramp = slope * slope * half_inverse + positive(next - c);
        lanes edge = p.s0 * (z - c_half) + next_ramp * (p.s1 - p.s0);
        lanes whole = between > 0 ? p.s0 : 0;
        if (most > 1) whole = whole + (between > 1 ? p.s1 : 0);
#define TAKE(k, pixel, last) { \
        if (k <= slanted) { \
          const lanes x = positive(z - (real)(k)); \
          edge = edge + x * x * half_inverse * ((pixel) - (last)); \
        } \
        if (k < most) whole = whole + (between > k ? (pixel) : 0); }
        TAKE(2, p.s2, p.s1)
        TAKE(3, p.s3, p.s2)
        for (int m = 4; m < most || m <= slanted; m += 4) {
          const lanes last = p.s3;
          p = quads_at(slab + m, places);
          TAKE(m, p.s0, last)
          TAKE(m + 1, p.s1, p.s0)
          TAKE(m + 2, p.s2, p.s1)
          TAKE(m + 3, p.s3, p.s2)
        }
        edges = edges + SLAB_WEIGHT(rho) * edge;
        sum = sum + SLAB_WEIGHT(rho) * whole;
#else
        const lanes reach = width > rho ? width / rho : 1.0f, inverse = 1.0f / reach;
        /* Pixels from `end` on have no share, and those behind the last line are zeros. */
        const lanes end = z + reach, rest = (real)lines - TO_FLOAT(i);
        const int most = (int)largest_lane(end < rest ? end : rest) + 1;
        lanes part = 0;
#define TAKE(pixel) { \
        part = part + hat(z, inverse) * (pixel); \
        z = z - 1.0f; }
        for (int m = 0; m < most; m += 4) {
          const lane_quad pixels = quads_at(slab + m, places);
          TAKE(pixels.s0)
          if (m + 1 < most) TAKE(pixels.s1)
          if (m + 2 < most) TAKE(pixels.s2)
          if (m + 3 < most) TAKE(pixels.s3)
        }
        sum = sum + SLAB_WEIGHT(rho) * part;
#endif
      }
#if FOOTPRINT == 0
      *(lanes *)(before + v * LANES) = edges;
      sum = sum - edges;
#endif
      lanes *held = (lanes *)(sums + v * LANES);
      *held = *held + sum;
    }
#if FOOTPRINT == 0
    for (int r = 0; r < own; r++) sums[r] += before[r + 1];
#endif
    if ((b0 + ROWS) % TOGETHER == 0)
      for (int r = 0; r < own; r++) {
        totals[r] += sums[r];
        sums[r] = 0;
      }
  }
  __global real *out = sinogram + (long)views[number] * bins;
  const int mirrored = (int)view[MIRRORED];
  for (int r = 0; r < own; r++)
    out[mirrored ? bins - 1 - r0 - r : r0 + r] = (totals[r] + sums[r]) * factors[at + r];
}
