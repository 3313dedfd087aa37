/* Transpose LANES vectors of LANES numbers in registers; nothing to do for a single lane.
 *
 * Three rounds of two-source shuffles, each of which exchanges blocks of half the size of the
 * round before: 4x4 blocks, then 2x2, then single numbers (24 shuffles for 64 numbers). */

#if LANES == 8
#define EXCHANGE4(a, b, v, w) \
  { const real8 low = (real8)((v).lo, (w).lo), high = (real8)((v).hi, (w).hi); a = low; b = high; }
#define EXCHANGE2(a, b, v, w) \
  { const real8 low = (real8)((v).s01, (w).s01, (v).s45, (w).s45); \
    const real8 high = (real8)((v).s23, (w).s23, (v).s67, (w).s67); a = low; b = high; }
#define EXCHANGE1(a, b, v, w) \
  { const real8 low = (real8)((v).s0, (w).s0, (v).s2, (w).s2, (v).s4, (w).s4, (v).s6, (w).s6); \
    const real8 high = (real8)((v).s1, (w).s1, (v).s3, (w).s3, (v).s5, (w).s5, (v).s7, (w).s7); \
    a = low; b = high; }
static void transpose8(real8 *v) {
  UNROLL for (int t = 0; t < 4; t++) EXCHANGE4(v[t], v[t + 4], v[t], v[t + 4])
  UNROLL for (int t = 0; t < 8; t += 4) {
    EXCHANGE2(v[t], v[t + 2], v[t], v[t + 2])
    EXCHANGE2(v[t + 1], v[t + 3], v[t + 1], v[t + 3])
  }
  UNROLL for (int t = 0; t < 8; t += 2) EXCHANGE1(v[t], v[t + 1], v[t], v[t + 1])
}
#define TRANSPOSE(v) transpose8(v);

/* Transpose 4 x 4 numbers within the lower halves of four vectors, and within the upper ones: no
 * number changes sides, which spares the slow shuffles. */
static void transpose_halves(real8 *v) {
  const real8 a = (real8)(v[0].s0, v[1].s0, v[0].s1, v[1].s1, v[0].s4, v[1].s4, v[0].s5, v[1].s5);
  const real8 b = (real8)(v[0].s2, v[1].s2, v[0].s3, v[1].s3, v[0].s6, v[1].s6, v[0].s7, v[1].s7);
  const real8 c = (real8)(v[2].s0, v[3].s0, v[2].s1, v[3].s1, v[2].s4, v[3].s4, v[2].s5, v[3].s5);
  const real8 d = (real8)(v[2].s2, v[3].s2, v[2].s3, v[3].s3, v[2].s6, v[3].s6, v[2].s7, v[3].s7);
  v[0] = (real8)(a.s01, c.s01, a.s45, c.s45);
  v[1] = (real8)(a.s23, c.s23, a.s67, c.s67);
  v[2] = (real8)(b.s01, d.s01, b.s45, d.s45);
  v[3] = (real8)(b.s23, d.s23, b.s67, d.s67);
}
/* Lane n is the sum of the lanes of v[n]: 14 shuffles and 7 additions for eight sums. */
static real8 sums_of_eight(const real8 *v) {
  real8 a[4], b[2];
  UNROLL for (int i = 0; i < 4; i++)
    a[i] = (real8)(v[i].lo, v[i + 4].lo) + (real8)(v[i].hi, v[i + 4].hi);
  UNROLL for (int i = 0; i < 2; i++)
    b[i] = (real8)(a[i].s01, a[i + 2].s01, a[i].s45, a[i + 2].s45) +
           (real8)(a[i].s23, a[i + 2].s23, a[i].s67, a[i + 2].s67);
  return (real8)(b[0].s0, b[1].s0, b[0].s2, b[1].s2, b[0].s4, b[1].s4, b[0].s6, b[1].s6) +
         (real8)(b[0].s1, b[1].s1, b[0].s3, b[1].s3, b[0].s5, b[1].s5, b[0].s7, b[1].s7);
}
#define SUM_OF_LANES(v) \
  ((((v).s0 + (v).s4) + ((v).s2 + (v).s6)) + (((v).s1 + (v).s5) + ((v).s3 + (v).s7)))
#else
#define TRANSPOSE(v)
#define SUM_OF_LANES(v) (v)
#endif
