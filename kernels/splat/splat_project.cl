/* Project splats: from Gaussians in space to conics, extents and tile rectangles on the screen.
 *
 *     screen[i] = (u, v, a, b, c, weight, extent_x, extent_y),
 *     sigma(pixel) = 0.5 (a dx^2 + c dy^2) + b dx dy,     (dx, dy) = (u, v) - pixel centre,
 *
 * where (a, b; b, c) is the inverse of the screen covariance plus eps2d, weight = opacity * factor
 * and the extents are half the sides of the rectangle round the splat's ellipse. boxes[i] =
 * (x0, y0, x1, y1) are the tiles that this rectangle touches when its extents are rounded up to
 * pixels (gsplat's radii), x1 and y1 exclusive. depths[i] is the camera's z, or how
 * far a splat is from a fisheye.
 *
 * An ellipse ends where weight * exp(-sigma) falls below 1/255, and at EXTENT standard deviations
 * at the latest; line integrals, which no display rounds, and SMOOTH cut-offs end at EXTENT always.
 * What ends there is the share (1/255) / weight of a splat's light: next to nothing in focus, but
 * all of it where an aperture spreads a small splat over so many pixels that no weight is left.
 * MODAL splats, which have Hermite modes or another activation, end where hermite_extent.h says.
 *
 * Splats that are not drawn get zeros and the reason in `culled`, the first of: not finite or
 * degenerate in what was given (2), out of depth (1), too large to tell (2), too faint (3),
 * clipped for its radius (5), off the screen (4). Index space: (runs of RUN splats), LANES of them at
 * a time.
 *
 * Buffers: means[count, 3], quats[count, 4], scales[count, 3], covars[count, 6], opacities[count],
 * screen[count, 8], depths[count], boxes[count, 4], culled[count], shape_modes[count, SHAPE_MODES],
 * color_modes[count, COLOR_MODES, COLOR_CHANNELS]. */

#include "include/portable.h"
#include "include/raster/alpha_threshold.h"
#include "include/logarithm.h"
#include "include/projection/camera.h"
#include "include/projection/aperture.h"
#include "include/projection/gaussian.h"

#ifndef TILE
#define TILE 16
#endif
#ifndef SMOOTH
#define SMOOTH 0
#endif
/* Whether splats have Hermite modes or another activation. */
#ifndef MODAL
#define MODAL 0
#endif
/* Standard deviations; alpha.h stops adding line integrals there as well. */
#define EXTENT (XRAY ? 4.0f : 3.33f)
/* Extents are held at this, so that rounded up they fit an int with room to add. */
#define MOST_PIXELS 1e9f

/* Largest whole number not above v, and smallest not below, held between 0 and most. */
static lanes_int whole_below(lanes v, float most) {
  const lanes above = v > 0 ? v : 0;
  return TO_INT(above < most ? above : most);
}

static lanes_int whole_above(lanes v, float most) {
  const lanes_int below = whole_below(v, most);
  return ((TO_FLOAT(below) < most) & (TO_FLOAT(below) < v)) ? below + 1 : below;
}

#if MODAL
#include "include/projection/hermite_project.h"
#include "include/raster/hermite_edge.h"
#include "include/projection/hermite_extent.h"
#define MODE_PARAMETERS , __global const float *restrict shape_modes, __global const float *restrict color_modes
#define NORMS_PARAMETER , const ModeNorms *norms
#define NORMS , &norms
#else
#define MODE_PARAMETERS
#define NORMS_PARAMETER
#define NORMS
#endif

/* How many standard deviations a splat of a weight reaches; adds the reason if it is too faint. */
static lanes extent_of(lanes weight, lanes_int *code NORMS_PARAMETER) {
#if MODAL
  *code = or_else(*code, !(weight >= LEAST_NORMAL), TOO_FAINT);
  const lanes extent = modal_extent(norms, weight);
  *code = or_else(*code, extent < 0, TOO_FAINT);
  return extent > 0 ? extent : 0;
#else
  *code = or_else(*code, !(weight >= (XRAY ? LEAST_NORMAL : ALPHA_THRESHOLD)), TOO_FAINT);
  if (XRAY || SMOOTH) return EXTENT;
  const lanes at_threshold = root_of(2 * natural_log(larger(weight * (1 / ALPHA_THRESHOLD), 1)));
  return at_threshold < EXTENT ? at_threshold : EXTENT;
#endif
}

/* Extent of a splat on the screen and in tiles; gives VISIBLE, or why it is not drawn. */
static lanes_int bound(
    const Gaussian *g, lanes_int code, lanes weight, float radius_clip, int width, int height,
    lanes *extents, lanes_int *box NORMS_PARAMETER)
{
#if MODAL
  const lanes extent = extent_of(weight, &code, norms);
#else
  const lanes extent = extent_of(weight, &code);
#endif
  const lanes reach_x = extent * root_of(dot_of(g->v0, g->v0) + g->eps);
  const lanes reach_y = extent * root_of(dot_of(g->v1, g->v1) + g->eps);
  extents[0] = reach_x < MOST_PIXELS ? reach_x : MOST_PIXELS;
  extents[1] = reach_y < MOST_PIXELS ? reach_y : MOST_PIXELS;
  const lanes rx = TO_FLOAT(whole_above(extents[0], 1 << 30)), ry = TO_FLOAT(whole_above(extents[1], 1 << 30));
  code = or_else(code, (rx <= radius_clip) & (ry <= radius_clip), CLIPPED);
  const lanes left = g->screen.u - rx, right = g->screen.u + rx;
  const lanes top = g->screen.v - ry, bottom = g->screen.v + ry;
  const lanes_int inside = (right > 0) & (left < (float)width) & (bottom > 0) & (top < (float)height);
  const float across = (width + TILE - 1) / TILE, down = (height + TILE - 1) / TILE;
  box[0] = whole_below(left / (float)TILE, across);
  box[1] = whole_below(top / (float)TILE, down);
  box[2] = whole_above(right / (float)TILE, across);
  box[3] = whole_above(bottom / (float)TILE, down);
  return or_else(code, !(inside & (box[0] < box[2]) & (box[1] < box[3])), OFF_SCREEN);
}

/* What a splat is on the screen: the row and the rectangle of tiles; gives VISIBLE, or why it is not drawn. */
static lanes_int project(
    const Gaussian *g, lanes_int code, lanes opacity, float radius_clip, int width, int height,
    lanes *row, lanes_int *box NORMS_PARAMETER)
{
  row[0] = g->screen.u;
  row[1] = g->screen.v;
  row[2] = (dot_of(g->v1, g->v1) + g->eps) * g->inverse;
  row[3] = -dot_of(g->v0, g->v1) * g->inverse;
  row[4] = (dot_of(g->v0, g->v0) + g->eps) * g->inverse;
  row[5] = opacity * g->factor;
  code = or_else(
      code, no_number(row[2]) | no_number(row[3]) | no_number(row[4]) | no_number(row[5]), DEGENERATE);
#if MODAL
  code = or_else(code, !modes_are_finite(norms) | !whitening_is_finite(g), DEGENERATE);
  return bound(g, code, row[5], radius_clip, width, height, row + 6, box, norms);
#else
  return bound(g, code, row[5], radius_clip, width, height, row + 6, box);
#endif
}

KERNEL void splat_project(
    __global const float *restrict means, SHAPES, __global const float *restrict opacities,
    __global float *restrict screen, __global float *restrict depths, __global int *restrict boxes,
    __global uchar *restrict culled, CAMERA_PARAMETERS,
    float near_plane, float far_plane, float radius_clip, float eps2d, int count MODE_PARAMETERS)
{
  const Camera camera = CAMERA;
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    Gaussian g;
    lanes row[8];
    lanes_int box[4];
    const lanes opacity = read_numbers(opacities, rows);
    lanes_int code = no_number(opacity) ? (lanes_int)DEGENERATE : (lanes_int)VISIBLE;
    const lanes_int seen = see_gaussian(&g, camera, means, SHAPE, rows, near_plane, far_plane, eps2d);
    code = code == VISIBLE ? seen : code;
#if MODAL
    const ModeNorms norms = norms_of(shape_modes, color_modes, rows);
#endif
    code = project(&g, code, opacity, radius_clip, width, height, row, box NORMS);
    const lanes_int drawn = code == VISIBLE;
    UNROLL for (int k = 0; k < 8; k++) row[k] = drawn ? row[k] : 0;
    UNROLL for (int k = 0; k < 4; k++) box[k] = drawn ? box[k] : 0;
    write_columns(screen, 8, 0, 8, rows, row);
    write_ints(boxes, 4, 0, 4, rows, box);
    write_numbers(depths, rows, drawn ? depth_of(g.point) : 0);
    write_bytes(culled, rows, code);
  }
}
