/* Project splats: from Gaussians in space to conics, extents and tile rectangles on the screen.
 *
 *     screen[i] = (u, v, a, b, c, weight, extent_x, extent_y),
 *     sigma(pixel) = 0.5 (a dx^2 + c dy^2) + b dx dy,     (dx, dy) = (u, v) - pixel centre,
 *
 * where (a, b; b, c) is the inverse of the screen covariance plus eps2d, weight = opacity * factor
 * and the extents are half the sides of the rectangle round the splat's ellipse. boxes[i] =
 * (x0, y0, x1, y1) are the tiles that this rectangle touches when its extents are rounded up to
 * pixels (gsplat's radii), x1 and y1 exclusive. depths[i] is the camera's z.
 *
 * An ellipse ends where weight * exp(-sigma) falls below 1/255, and at EXTENT standard deviations
 * at the latest; line integrals, which no display rounds, and SMOOTH cut-offs end at EXTENT always.
 * What ends there is the share (1/255) / weight of a splat's light: next to nothing in focus, but
 * all of it where an aperture spreads a small splat over so many pixels that no weight is left.
 * MODAL splats, which have Hermite modes or another activation, end where hermite_extent.h says.
 *
 * Splats that are not drawn get zeros and the reason in `culled`, the first of: not finite or
 * degenerate in what was given (2), out of depth (1), too large to tell (2), too faint (3),
 * clipped for its radius (5), off the screen (4). Index space: splats. */

#include "include/portable.h"
#include "include/alpha_threshold.h"
#include "include/logarithm.h"
#include "include/small_matrix.h"
#include "include/camera.h"
#include "include/aperture.h"
#include "include/gaussian.h"

#ifndef TILE
#define TILE 16
#endif
#ifndef SMOOTH
#define SMOOTH 0
#endif
/* Standard deviations; alpha.h stops adding line integrals there as well. */
#define EXTENT (XRAY ? 4.0f : 3.33f)
/* Whether splats have Hermite modes or another activation. */
#ifndef MODAL
#define MODAL 0
#endif
/* Extents are held at this, so that rounded up they fit an int with room to add. */
#define MOST_PIXELS 1e9f

/* Largest whole number not above v, and smallest not below, held between 0 and most. */
static int whole_below(float v, int most) { return v < 0 ? 0 : v > most ? most : (int)v; }

static int whole_above(float v, int most) {
  const int below = whole_below(v, most);
  return below < most && below < v ? below + 1 : below;
}

#if MODAL
#include "include/hermite_project.h"
#include "include/hermite_edge.h"
#include "include/hermite_extent.h"
#define MODE_PARAMETERS , __global const float *restrict shape_modes, __global const float *restrict color_modes
#define NORMS_PARAMETER , const ModeNorms *norms
#define NORMS , &norms
#define NORMS_AGAIN , norms
#else
#define MODE_PARAMETERS
#define NORMS_PARAMETER
#define NORMS
#define NORMS_AGAIN
#endif

/* Extent of a splat on the screen and in tiles; gives VISIBLE, or why it is not drawn. */
static int bound(
    const Gaussian *g, float weight, float radius_clip, int width, int height, float *extents, int *box
    NORMS_PARAMETER)
{
#if MODAL
  if (!(weight >= LEAST_NORMAL)) return TOO_FAINT;
  const float extent = modal_extent(norms, weight);
  if (extent < 0) return TOO_FAINT;
#else
  float extent = EXTENT;
  if (!(weight >= (XRAY ? LEAST_NORMAL : ALPHA_THRESHOLD))) return TOO_FAINT;
  if (!XRAY && !SMOOTH) {
    const float at_threshold = sqrt(2 * natural_log(larger(weight / ALPHA_THRESHOLD, 1)));
    extent = at_threshold < EXTENT ? at_threshold : EXTENT;
  }
#endif
  const float reach_x = extent * sqrt(dot3(g->v0, g->v0) + g->eps);
  const float reach_y = extent * sqrt(dot3(g->v1, g->v1) + g->eps);
  extents[0] = reach_x < MOST_PIXELS ? reach_x : MOST_PIXELS;
  extents[1] = reach_y < MOST_PIXELS ? reach_y : MOST_PIXELS;
  const float rx = whole_above(extents[0], 1 << 30), ry = whole_above(extents[1], 1 << 30);
  if (rx <= radius_clip && ry <= radius_clip) return CLIPPED;
  const float left = g->screen.u - rx, right = g->screen.u + rx;
  const float top = g->screen.v - ry, bottom = g->screen.v + ry;
  if (!(right > 0 && left < width && bottom > 0 && top < height)) return OFF_SCREEN;
  const int across = (width + TILE - 1) / TILE, down = (height + TILE - 1) / TILE;
  box[0] = whole_below(left / TILE, across);
  box[1] = whole_below(top / TILE, down);
  box[2] = whole_above(right / TILE, across);
  box[3] = whole_above(bottom / TILE, down);
  return box[0] < box[2] && box[1] < box[3] ? VISIBLE : OFF_SCREEN;
}

/* The screen's row of a splat, its rectangles, and why it is not drawn. */
static int project(
    const Gaussian *g, float opacity, float radius_clip, int width, int height,
    float *row, int *box NORMS_PARAMETER)
{
  row[0] = g->screen.u;
  row[1] = g->screen.v;
  row[2] = (dot3(g->v1, g->v1) + g->eps) * g->inverse;
  row[3] = -dot3(g->v0, g->v1) * g->inverse;
  row[4] = (dot3(g->v0, g->v0) + g->eps) * g->inverse;
  row[5] = opacity * g->factor;
  if (not_finite(row[2]) | not_finite(row[3]) | not_finite(row[4]) | not_finite(row[5])) return DEGENERATE;
#if MODAL
  if (!modes_are_finite(norms) || !whitening_is_finite(g)) return DEGENERATE;
#endif
  return bound(g, row[5], radius_clip, width, height, row + 6, box NORMS_AGAIN);
}

KERNEL void splat_project(
    __global const float *restrict means, SHAPES, __global const float *restrict opacities,
    __global float *restrict screen, __global float *restrict depths, __global int *restrict boxes,
    __global uchar *restrict culled, CAMERA_PARAMETERS,
    float near_plane, float far_plane, float radius_clip, float eps2d, int count MODE_PARAMETERS)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  Gaussian g;
  float row[8];
  int box[4];
  const float opacity = opacities[i];
  int code = not_finite(opacity) ? DEGENERATE
      : see_gaussian(&g, CAMERA, means, SHAPE, i, near_plane, far_plane, eps2d);
#if MODAL
  const ModeNorms norms = norms_of(shape_modes, color_modes, i);
#endif
  if (code == VISIBLE) code = project(&g, opacity, radius_clip, width, height, row, box NORMS);
  const int drawn = code == VISIBLE;
  for (int k = 0; k < 8; k++) screen[8 * i + k] = drawn ? row[k] : 0;
  for (int k = 0; k < 4; k++) boxes[4 * i + k] = drawn ? box[k] : 0;
  depths[i] = drawn ? g.point.z : 0;
  culled[i] = (uchar)code;
}
