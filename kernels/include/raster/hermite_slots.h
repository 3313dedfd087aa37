/* The record that a (splat, tile) pair with Hermite modes leaves for its projection's gradient.
 *
 *     H_ij = sum over pixels of h He~_i(u1) He~_j(u2),   i + j <= SHAPE_ORDER + 2,
 *            h = dL/dE weight g,  with SQUARED dL/dE weight g Q; zero where E is clamped;
 *     V_00c = sum of w v_c for each of CHANNELS channels, with v = dL/dC and w as in the image;
 *     V_ijc = sum of w v_c He~_i(u1) He~_j(u2),   1 <= i + j <= COLOR_ORDER, c < COLORED,
 *
 * in this order, modes graded as in include/raster/hermite_modes.h. All that a splat is gets its
 * gradient from these numbers, since d/du_a (He~_m g) = -sqrt(m_a + 1) He~_{m + e_a} g and
 * u_a He~_m = sqrt(m_a + 1) He~_{m + e_a} + sqrt(m_a) He~_{m - e_a}:
 *
 *     dL/ds_m = H_m,   weight dL/dweight = sum of s_m H_m (s_00 = 1),   dL/dt_mc = V_mc,
 *     sum of dL/du_a u_b^k from H to order SHAPE_ORDER + 1 + k, V to COLOR_ORDER - 1 + k. */

#define SHAPE_MOMENTS MODES(SHAPE_ORDER + 2)
#define RECORD (SHAPE_MOMENTS + CHANNELS + (MODES(COLOR_ORDER) - 1) * COLORED)
/* Where V_ijc stands. */
#define COLOR_MOMENT(i, j, c) \
  (SHAPE_MOMENTS + ((i) + (j) == 0 ? 0 : CHANNELS + (MODE(i, j) - 1) * COLORED) + (c))
/* Highest order of a polynomial that a moment has. */
#define MOMENT_ORDER (SHAPE_ORDER + 2 > COLOR_ORDER ? SHAPE_ORDER + 2 : COLOR_ORDER)
