/* What a tile wants of a splat on the screen, in one line of memory: RECORD_NUMBERS numbers.
 *
 * With (dx, dy) = pixel centre - mean and L^-1 = (i00, 0; i10, i11) the whitening of the splat's
 * covariance on the screen,
 *
 *     log2(weight exp(-sigma)) = peak - (far dx)^2 - (lean dx + rise dy)^2,
 *     peak = log2 weight,    (far, lean, rise) = STRETCH (i00, i10, i11),
 *
 * so that a pixel costs a multiply-add once its column is known, the next row's place is a constant
 * more, and rounding never lifts a needle above its peak. Of a conic (a, b; b, c) the whitening is
 * i11 = sqrt(c), i10 = b / i11, i00 = sqrt(a - i10^2).
 *
 * The rest bounds the ellipse sigma <= sigma_max, of which only the half sides (ex, ey) of its box
 * are given. Solved for v = dy at a column u = dx it is
 *
 *     slope u +- reach sqrt(1 - (u / ex)^2),    slope = -b / c,    reach = ey sqrt(1 - b^2 / (a c)),
 *
 * and its highest row, v = ey, lies at u = summit = -(b / a) ey, its lowest at -summit. The root's
 * argument gets a little more than rounding can take from it: a needle is bounded too widely, never
 * too closely.
 *
 * Up to RECORD_FEATURES features fill the line; a splat with more keeps them elsewhere. */

#define RECORD_NUMBERS 16
#define RECORD_FEATURES 5
#define RECORD_X 0
#define RECORD_Y 1
#define RECORD_FAR 2
#define RECORD_LEAN 3
#define RECORD_RISE 4
#define RECORD_PEAK 5
#define RECORD_SLOPE 6
#define RECORD_SUMMIT 7
#define RECORD_REACH 8
#define RECORD_EXTENT 9
#define RECORD_PER_EXTENT 10
#define RECORD_FEATURE 11

/* sqrt(log2(e) / 2), log2(e), and what the root's argument gets. */
#define STRETCH 0.8493218f
#define LOG2_E 1.44269504f
#define RECORD_MARGIN 1e-6f
