/* The record that a (splat, tile) pair leaves for the gradient of its projection.
 *
 *     (S, Sx, Sy, Sxx, Sxy, Syy, dL/dc of each channel [, |dL/dmean_x|, |dL/dmean_y|])
 *
 * S is -weight dL/dweight; Sx.. are the moments of dL/dsigma with dx, dy, dx^2, dx dy, dy^2.
 * ABSGRAD adds the last two.
 * A launch does CHANNELS of the `stride` channels of a splat, from channel `first`. The gradient
 * is linear in dL/dC, so launches after the first add to the numbers that all channels share. */

#ifndef ABSGRAD
#define ABSGRAD 0
#endif
/* Numbers that a launch computes, and numbers that a record has. */
#define RECORD (6 + CHANNELS + 2 * ABSGRAD)
#define RECORD_LENGTH (6 + stride + 2 * ABSGRAD)
/* Where number n of a launch stands in the record, and whether all channels share it. */
#define PLACE(n) ((n) < 6 ? (n) : (n) < 6 + CHANNELS ? (n) + first : (n) - CHANNELS + stride)
#define SHARED(n) ((n) < 6 || (n) >= 6 + CHANNELS)
