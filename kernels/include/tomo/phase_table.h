/* The phase table: a view of a parallel scan resampled so that backprojection needs no gathers.
 *
 * A pixel meets the detector at t = x cos(a) + y sin(a). Walk along an image row (fixed y): t
 * grows by dx cos(a) from column to column, so a whole row reads the view at equal steps, and
 * rows differ in where they start. So resample the view once at that step, at PHASES sub-steps,
 *
 *     F[r][k] = view((k + r / PHASES) * step),      r = 0 .. PHASES-1,
 *
 * and each row becomes two contiguous runs of F, blended with one weight for the whole row:
 *
 *     out[j] += (1 - w) F[r][m + j] + w F[r + 1][m + j],      m + (r + w) / PHASES = row's start,
 *
 * where F[PHASES][k] = F[0][k + 1]. Views with |dy sin| > |dx cos| do the same on columns. The
 * projector is the transpose of these steps in reverse order with the same numbers. The blend is
 * exact where the view's interpolant is straight; at its kinks it errs by O(1 / PHASES^2).
 *
 * Positions are 32.32 fixed-point: every kernel sees the same m, r and w, bit for bit, and the
 * error is 2^-33 of a column per row at any size, in double precision as well.
 *
 * geometry[view] = (base, slope, origin, step): row i starts at column base + slope * i, and
 * column k of phase 0 lies on detector bin origin + step * k. */

#ifndef LOG2_PHASES
#define LOG2_PHASES 3
#endif
#define PHASES (1 << LOG2_PHASES)

#ifndef BLOCKS
#define BLOCKS (LANES == 8 ? 8 : 1)
#endif
/* An item handles BLOCKS times LANES columns, STEP apart. A CPU's lie side by side. On a GPU other items
 * take those between, so that the loads of neighbours are one, while each finds out once where a row
 * starts: that is some forty operations, beside four for a column. */
#ifndef STEP
#define STEP LANES
#endif
/* Columns that STEP / LANES items handle together. */
#define SEGMENT (STEP * BLOCKS)
#define FIRST_COLUMN(item) ((item) / (STEP / LANES) * SEGMENT + (item) % (STEP / LANES) * LANES)

/* What describes a pixel's shadow in a view, eight numbers: see footprint.h and shadow.h. */
typedef struct {
  real s0, s1, s2, s3, s4, s5, s6, s7;
} view_shape;

static view_shape shape_of_view(__global const real *shapes, int view) {
  __global const real *s = shapes + 8L * view;
  const view_shape shape = {s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7]};
  return shape;
}

#define FIXED_TO_REAL(p) ((real)(p) * (1.0f / 4294967296.0f))
#define WHOLE(p) ((int)((p) >> 32))

static int phase_of(long position) { return (int)((uint)position >> (32 - LOG2_PHASES)); }

/* Weight of the next phase: the fraction below the phase, to the 24 bits that a float holds. */
static real next_weight(long position) {
  const uint fraction = (uint)position << LOG2_PHASES;
#if DOUBLE
  return (real)fraction * (1.0f / 4294967296.0f);
#else
  return (float)(int)(fraction >> 8) * (1.0f / 16777216.0f);
#endif
}

/* Distances in bins from bin b to the places of LANES phases, from `phase` on, of column k. Both
 * resampling kernels ask here, so that they weight alike to the bit, however narrow a footprint. */
#define DISTANCES(g, k, phase, b) \
  (FIXED_TO_REAL((g).z + (k) * (g).w - ((long)(b) << 32)) + \
   ((real)(phase) + LANE_NUMBERS) * (FIXED_TO_REAL((g).w) * (1.0f / PHASES)))
