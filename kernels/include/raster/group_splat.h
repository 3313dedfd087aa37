/* What a splat does to a pixel on a GPU: the same lines for compositing and its gradient, for
 * Gaussians, which are of order 0, and for splats with Hermite modes (MODAL).
 *
 * A splat lies in local memory as QUADS vectors of four numbers, of which all items of a sub-group
 * read the same: its place from the part's corner and its whitening (x, y, far, lean | rise, peak, ..)
 * of include/raster/screen_record.h, then its features, which fill the second vector and further
 * ones. A splat with modes has its own number before its features: its modes, too many for local
 * memory, are read where they lie.
 *
 * Thresholds are those of include/raster/alpha_threshold.h, smooth cut-offs those of
 * include/raster/alpha.h and include/raster/hermite_alpha.h. */

/* Whether the features are those in the records. */
#ifndef PACKED
#define PACKED 0
#endif

/* Numbers of a splat that are not its features, and vectors of four that hold them all. */
#define SEEN_NUMBERS (6 + MODAL)
#define QUADS ((SEEN_NUMBERS + CHANNELS + 3) / 4)
#define SPLAT_X 0
#define SPLAT_Y 1
#define SPLAT_FAR 2
#define SPLAT_LEAN 3
#define SPLAT_RISE 4
#define SPLAT_PEAK 5
#define SPLAT_NUMBER 6

/* A splat at a pixel: its peak times the exponential, and that as it counts, with its polynomial. */
typedef struct {
  float distance;               /* (sigma log2 e) */
  float exponential;
  float density;                /* zero where it does not count */
#if MODAL
  float shaped, he1[ORDER + 1], he2[ORDER + 1];
#endif
} Seen;

#if MODAL
#define MODES_OF(splat, modes) ((modes) + (long)as_int((splat)[SPLAT_NUMBER]) * ROW)
#define AND_MODES_ARGUMENT , __global const float *restrict modes
#define AND_MODES , modes
#else
#define AND_MODES_ARGUMENT
#define AND_MODES
#endif

/* The pixel's centre is (x, y) from the part's corner. */
static Seen see(const float *splat, float x, float y AND_MODES_ARGUMENT) {
  Seen s;
  const float dx = x - splat[SPLAT_X], dy = y - splat[SPLAT_Y];
  const float far = splat[SPLAT_FAR] * dx, near = splat[SPLAT_LEAN] * dx + splat[SPLAT_RISE] * dy;
  s.distance = far * far + near * near;
  const float power = splat[SPLAT_PEAK] - s.distance;
  s.exponential = two_to_the(power);
#if MODAL
  __global const float *mode = MODES_OF(splat, modes);
  const int within = -s.distance >= LEAST_POWER;
  hermite_values(s.he1, within ? far / STRETCH : 0, ORDER);
  hermite_values(s.he2, within ? near / STRETCH : 0, ORDER);
  s.shaped = polynomial_of_modes(1, mode + 3, 1, s.he1, s.he2, SHAPE_ORDER);
  s.exponential = within ? s.exponential : 0;
  s.density = density_that_counts((SQUARED ? s.shaped * s.shaped : s.shaped) * s.exponential, within);
#elif SMOOTH
  const float rest = 1 + s.distance * (TO_SIGMA / SMOOTH_EDGE), left = rest > 0 ? rest : 0;
  s.density = s.exponential * left * left;
#elif ADDITIVE
  s.density = s.distance <= -TO_POWER * ADDED_EDGE ? s.exponential : 0;
#else
  s.density = power >= ALPHA_THRESHOLD_LOG2 ? s.exponential : 0;
#endif
  return s;
}

/* Channel n of its colour there. */
static float color_seen(const Seen *s, const float *splat, int n AND_MODES_ARGUMENT) {
  const float feature = splat[SEEN_NUMBERS + n];
#if MODAL
  return color_at(feature, MODES_OF(splat, modes), n, s->he1, s->he2);
#else
  return feature;
#endif
}

/* What is hidden of what lies behind it, of what that were without a cap. Gaussians with smooth
 * cut-offs have none. */
static float capped(float hidden, float most) {
  return (SMOOTH && !MODAL) || hidden < most ? hidden : most;
}

static void read_splat(float *splat, __local const float4 *staged, int entry) {
  UNROLL for (int q = 0; q < QUADS; q++) {
    const float4 four = staged[q * BATCH + entry];
    splat[4 * q] = four.x;
    splat[4 * q + 1] = four.y;
    splat[4 * q + 2] = four.z;
    splat[4 * q + 3] = four.w;
  }
}

/* Fetch one entry into local memory; the bits of the blocks that it reaches are returned. (x0, y0) is
 * the part's corner. Features are those of the record where it has all that there are. */
static uint fetch_splat(
    __local float4 *staged, int entry, int splat, float x0, float y0, __global const float *restrict packed,
    __global const float *restrict features, int stride, int first)
{
  __global const float4 *record = (__global const float4 *)(packed + (long)splat * RECORD_NUMBERS);
  const float4 place = record[0], shape = record[1], bounds = record[2];
  const float x = place.x - x0, y = place.y - y0;
  float numbers[4 * QUADS];
  numbers[SPLAT_X] = x;
  numbers[SPLAT_Y] = y;
  numbers[SPLAT_FAR] = place.z;
  numbers[SPLAT_LEAN] = place.w;
  numbers[SPLAT_RISE] = shape.x;
  numbers[SPLAT_PEAK] = shape.y;
#if MODAL
  numbers[SPLAT_NUMBER] = as_float(splat);
#endif
#if PACKED
  /* CHANNELS <= RECORD_FEATURES. */
  const float4 others = record[3];
  const float feature[5] = {bounds.w, others.x, others.y, others.z, others.w};
#else
  __global const float *feature = features + (long)splat * stride + first;
#endif
  UNROLL for (int n = SEEN_NUMBERS; n < 4 * QUADS; n++)
    numbers[n] = n < SEEN_NUMBERS + CHANNELS ? feature[n - SEEN_NUMBERS] : 0;
  UNROLL for (int q = 0; q < QUADS; q++)
    staged[q * BATCH + entry] =
        (float4)(numbers[4 * q], numbers[4 * q + 1], numbers[4 * q + 2], numbers[4 * q + 3]);
  return blocks_reached(x, y, shape.z, shape.w, bounds.x, bounds.y, bounds.z);
}
