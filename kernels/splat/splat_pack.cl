/* Pack what tiles want of each splat into one line of memory: include/raster/screen_record.h.
 *
 * MODAL splats give their whitening, the first three of the ROW numbers that each has in `modes`;
 * Gaussians have it from their conic. Splats that are not drawn get a record that is never read.
 * Index space: (runs of RUN splats), LANES of them at a time.
 *
 * Buffers: screen[count, 8], features[count, CHANNELS], packed[count, RECORD_NUMBERS], modes[count, row]. */

#include "include/portable.h"
#include "include/logarithm.h"
#include "include/splat/splat_rows.h"
#include "include/raster/screen_record.h"

#ifndef MODAL
#define MODAL 0
#endif
#ifndef CHANNELS
#define CHANNELS 3
#endif

#if MODAL
#define MODE_PARAMETERS , __global const float *restrict modes, int row
#else
#define MODE_PARAMETERS
#endif
#define PACKED_FEATURES (CHANNELS < RECORD_FEATURES ? CHANNELS : RECORD_FEATURES)

KERNEL void splat_pack(
    __global const float *restrict screen, __global const float *restrict features,
    __global float *restrict packed, int count MODE_PARAMETERS)
{
  EACH_RUN(first, count) {
    const Rows rows = rows_at(first, count);
    lanes s[8], record[RECORD_NUMBERS];
    read_columns(screen, 8, 0, 8, rows, s);
    const lanes a = s[2], b = s[3], c = s[4], weight = s[5], across = s[6], down = s[7];
    const lanes slope = -b / c, summit = -b / a, narrow = 1 - summit * slope;
#if MODAL
    lanes whitening[3];
    read_columns(modes, row, 0, 3, rows, whitening);
    const lanes i00 = whitening[0], i10 = whitening[1], i11 = whitening[2];
#else
    const lanes per_i11 = inverse_root(c), i11 = c * per_i11, i10 = b * per_i11, left = a + b * slope;
    const lanes i00 = root_of(left > 0 ? left : 0);
#endif
    record[RECORD_X] = s[0];
    record[RECORD_Y] = s[1];
    record[RECORD_FAR] = STRETCH * i00;
    record[RECORD_LEAN] = STRETCH * i10;
    record[RECORD_RISE] = STRETCH * i11;
    record[RECORD_PEAK] = LOG2_E * natural_log(larger(weight, LEAST_NORMAL));
    record[RECORD_SLOPE] = slope;
    record[RECORD_SUMMIT] = summit * down;
    record[RECORD_REACH] = down * root_of((narrow > 0 ? narrow : 0) + RECORD_MARGIN);
    record[RECORD_EXTENT] = across;
    record[RECORD_PER_EXTENT] = 1 / across;
    read_columns(features, CHANNELS, 0, PACKED_FEATURES, rows, record + RECORD_FEATURE);
    UNROLL for (int n = PACKED_FEATURES; n < RECORD_FEATURES; n++) record[RECORD_FEATURE + n] = 0;
    write_columns(packed, RECORD_NUMBERS, 0, RECORD_NUMBERS, rows, record);
  }
}
