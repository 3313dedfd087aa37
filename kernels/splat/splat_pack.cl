/* Pack what tiles want of each splat into one line of memory: include/screen_record.h.
 *
 * MODAL splats give their whitening, the first three of the ROW numbers that each has in `modes`;
 * Gaussians have it from their conic. Splats that are not drawn get a record that is never read.
 * Index space: splats. */

#include "include/portable.h"
#include "include/logarithm.h"
#include "include/screen_record.h"

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

KERNEL void splat_pack(
    __global const float *restrict screen, __global const float *restrict features,
    __global float *restrict packed, int count MODE_PARAMETERS)
{
  const long i = get_global_id(0);
  if (i >= count) return;
  __global const float *s = screen + 8 * i;
  __global float *record = packed + RECORD_NUMBERS * i;
  const float a = s[2], b = s[3], c = s[4], weight = s[5], across = s[6], down = s[7];
#if MODAL
  const float i00 = modes[i * row], i10 = modes[i * row + 1], i11 = modes[i * row + 2];
#else
  const float i11 = sqrt(c), i10 = b / i11, left = a - b * (b / c), i00 = sqrt(left > 0 ? left : 0);
#endif
  const float narrow = 1 - (b / a) * (b / c);
  record[RECORD_X] = s[0];
  record[RECORD_Y] = s[1];
  record[RECORD_FAR] = STRETCH * i00;
  record[RECORD_LEAN] = STRETCH * i10;
  record[RECORD_RISE] = STRETCH * i11;
  record[RECORD_PEAK] = LOG2_E * natural_log(weight > LEAST_NORMAL ? weight : LEAST_NORMAL);
  record[RECORD_SLOPE] = -b / c;
  record[RECORD_SUMMIT] = -b / a * down;
  record[RECORD_REACH] = down * sqrt((narrow > 0 ? narrow : 0) + RECORD_MARGIN);
  record[RECORD_EXTENT] = across;
  record[RECORD_PER_EXTENT] = 1 / across;
  for (int n = 0; n < RECORD_FEATURES; n++)
    record[RECORD_FEATURE + n] = n < CHANNELS ? features[i * CHANNELS + n] : 0;
}
