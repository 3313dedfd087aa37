/* Prepare splats for a grid of voxels: dilated, in steps of the grid, as powers along its axes.
 *
 *     density(x) = opacity (1 + sum of c_n He~_n(x')) exp(-|x'|^2 / 2),     x' = F^-1 (x - mean),
 *
 * blurred with a Gaussian of variances D = diag(d), its mass kept. With F F^T + D = U U^T and
 * A = U^-1 F this is again a splat, of u = U^-1 (x - mean),
 *
 *     opacity det F / det U (1 + sum of b_m He_m(u)) exp(-|u|^2 / 2),
 *
 * whose coefficients b are those of include/projection/hermite_space.h. U is upper triangular:
 * along a row of voxels then u_0 alone changes, so that the polynomial is one of a single variable
 * there.
 *
 * U comes from the rows of the 3 x 6 matrix [F, sqrt(D)] = U Q by Gram and Schmidt, z first, twice
 * over since once is not enough for needles; A is the first half of Q. Neither that nor
 *
 *     det(F F^T + D) = det F^2 + sum d_i |f_j x f_k|^2 + sum d_i d_j |f_k|^2 + d_0 d_1 d_2
 *
 * subtracts covariances from each other. All of it is done in units of the splat's own size.
 *
 * rows[i] = (1 / U_00, 1 / U_11, 1 / U_22, U_01, U_02, U_12, the mean's voxel and what is left of
 * its place (x, y, z each), then opacity det F / det U times the coefficients of u_0^a u_1^b u_2^c,
 * a falling, within it b falling, within it c falling: the order of Horner's rule).
 * extents[i] = half the sides of the box that the splat fills, in voxels: HERMITE_EDGE standard deviations;
 * negative where there is nothing to draw (as in splat_project.cl: degenerate or not finite).
 *
 * Index space: splats.
 *
 * Buffers: quats[count, 4], scales[count, 3], covars[count, 6], opacities[count],
 * shape_modes[count, MODES - 1], places[count, 6], table[count, WIDTH], extents[count, 3]. */

/* One splat at a time: the modes of eight would fill more registers than there are. */
#undef LANES
#define LANES 1
#include "include/portable.h"
#include "include/small_matrix.h"
#include "include/projection/camera.h"
#include "include/projection/aperture.h"
#include "include/projection/gaussian.h"
#include "include/projection/hermite_space.h"
#include "include/raster/hermite_edge.h"

#define REACH HERMITE_EDGE(ORDER)
#define SHAPE_NUMBERS 12
#define WIDTH (SHAPE_NUMBERS + MODES)
/* Sizes, in voxels, between which a splat's own size is a unit. */
#define LEAST_SIZE 1e-30f
#define MOST_SIZE 1e30f
/* A needle's width, as a share of its length, is at least this. */
#define LEAST_PIVOT 1e-12f

typedef struct {
  float3 f, d;
} row6;

static float dot6(row6 v, row6 w) { return dot3(v.f, w.f) + dot3(v.d, w.d); }

/* Take the part along q, which has length 1, out of v; gives how long that part was. */
static float take_out(row6 *v, row6 q) {
  float along = 0;
  for (int pass = 0; pass < 2; pass++) {
    const float more = dot6(*v, q);
    v->f -= more * q.f;
    v->d -= more * q.d;
    along += more;
  }
  return along;
}

/* Bring v to length 1; gives how long it was. */
static float normalise(row6 *v) {
  const float length = larger(sqrt(dot6(*v, *v)), LEAST_PIVOT);
  v->f *= 1 / length;
  v->d *= 1 / length;
  return length;
}

static float largest3(float3 v) { return larger(larger(absolute1(v.x), absolute1(v.y)), absolute1(v.z)); }

/* det F / det U of rows f in the splat's unit: 1 without dilation, whatever the shape. */
static float mass_factor(const row6 *rows, float det) {
  const float3 x = rows[0].f, y = rows[1].f, z = rows[2].f;
  const float dx = rows[0].d.x * rows[0].d.x, dy = rows[1].d.y * rows[1].d.y, dz = rows[2].d.z * rows[2].d.z;
  const float3 yz = cross3(y, z), zx = cross3(z, x), xy = cross3(x, y);
  const float more = dx * dot3(yz, yz) + dy * dot3(zx, zx) + dz * dot3(xy, xy)
      + dx * dy * dot3(z, z) + dy * dz * dot3(x, x) + dz * dx * dot3(y, y) + dx * dy * dz;
  return more > 0 ? det / sqrt(det * det + more) : 1;
}

/* The shape's numbers, extents, the map A's columns and det F / det U; whether there is a splat. */
static int dilate(
    const Gaussian *g, float3 per_length, float3 blur, float *row, __global float *extents, float3 *columns,
    float *factor)
{
  row6 rows[3] = {{g->root.x * per_length.x, (float3)(blur.x, 0, 0)},
                  {g->root.y * per_length.y, (float3)(0, blur.y, 0)},
                  {g->root.z * per_length.z, (float3)(0, 0, blur.z)}};
  const float3 sides = (float3)(largest3(rows[0].f), largest3(rows[1].f), largest3(rows[2].f));
  const float size = larger(largest3(sides), largest3(blur)), per_size = 1 / size;
  if (!(size > LEAST_SIZE) || !(size < MOST_SIZE)) return 0;
  for (int k = 0; k < 3; k++) {
    rows[k].f *= per_size;
    rows[k].d *= per_size;
    extents[k] = REACH * size * sqrt(dot6(rows[k], rows[k]));
  }
#if COVARIANCES
  const float3 lengths = (float3)(g->root.x.x, g->root.y.y, g->root.z.z) * per_length * per_size;
#else
  const float3 lengths = g->scale * per_length * per_size;
#endif
  *factor = mass_factor(rows, lengths.x * lengths.y * lengths.z);
  row[2] = per_size / normalise(rows + 2);
  row[5] = size * take_out(rows + 1, rows[2]);
  row[1] = per_size / normalise(rows + 1);
  row[4] = size * take_out(rows, rows[2]);
  row[3] = size * take_out(rows, rows[1]);
  row[0] = per_size / normalise(rows);
  columns[0] = (float3)(rows[0].f.x, rows[1].f.x, rows[2].f.x);
  columns[1] = (float3)(rows[0].f.y, rows[1].f.y, rows[2].f.y);
  columns[2] = (float3)(rows[0].f.z, rows[1].f.z, rows[2].f.z);
  return 1;
}

/* Write coefficients of powers in the order of Horner's rule; whether all are finite. */
static int write_powers(float *modes, float amplitude, __global float *out) {
  int term = 0, broken = 0;
  UNROLL for (int dimension = 0; dimension < 3; dimension++) to_powers(modes, dimension);
  for (int a = ORDER; a >= 0; a--)
    for (int b = ORDER - a; b >= 0; b--)
      for (int c = ORDER - a - b; c >= 0; c--) {
        const float coefficient = amplitude * modes[mode_place(a, b, c)];
        broken |= not_finite(coefficient);
        out[term++] = coefficient;
      }
  return !broken;
}

KERNEL void hermite_dilate(
    SHAPES, __global const float *restrict opacities, __global const float *restrict shape_modes,
    __global const float *restrict places, __global float *restrict table, __global float *restrict extents,
    float per_x, float per_y, float per_z, float blur_x, float blur_y, float blur_z, int count)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  Gaussian g;
  float row[6], modes[MODES], factor = 0;
  float3 columns[3];
  __global float *out = table + WIDTH * i, *sides = extents + 3 * i;
  int drawn = read_shape(&g, SHAPE, rows_at(i, count)) == VISIBLE &&
      dilate(&g, (float3)(per_x, per_y, per_z), (float3)(blur_x, blur_y, blur_z), row, sides, columns, &factor);
  if (drawn) {
    for (int k = 0; k < 6; k++) {
      drawn &= !not_finite(row[k]);
      out[k] = row[k];
      out[6 + k] = places[6 * i + k];
    }
    modes[0] = 1;
    for (int k = 1; k < MODES; k++) modes[k] = shape_modes[(MODES - 1) * i + k - 1];
    map_modes(modes, columns[0], columns[1], columns[2]);
    drawn &= write_powers(modes, opacities[i] * factor, out + SHAPE_NUMBERS);
  }
  /* A choice between an array of the item's own and -1 is what clspv dies of. */
  if (!drawn) for (int k = 0; k < 3; k++) sides[k] = -1;
}
