/* Real spherical harmonics to degree 4, with the signs of 3D Gaussian Splatting (Kerbl et al.).
 *
 * On the unit sphere each is Q_lm(z) times the real or imaginary part of (x + i y)^m, m >= 0:
 *
 *     Y[l^2 + l + m] = Q_lm(z) C_m(x, y),      Y[l^2 + l - m] = Q_lm(z) S_m(x, y)  for m > 0.
 *
 * Their derivatives follow from dC_m = m (C_m-1 dx - S_m-1 dy), dS_m = m (S_m-1 dx + C_m-1 dy).
 * COEFFICIENTS is (degree + 1)^2. */

#ifndef COEFFICIENTS
#define COEFFICIENTS 16
#endif
#define DEGREE (COEFFICIENTS >= 25 ? 4 : COEFFICIENTS >= 16 ? 3 : COEFFICIENTS >= 9 ? 2 : COEFFICIENTS >= 4 ? 1 : 0)
#define DEGREES (DEGREE + 1)
/* Where Q_lm stands among all of them. */
#define Q_AT(l, m) ((l) * ((l) + 1) / 2 + (m))

/* Q_lm and dQ_lm/dz. */
static void sh_heights(float z, float *q, float *dq) {
  const float zz = z * z;
  q[0] = 0.28209479177387814f; dq[0] = 0;
#if DEGREE >= 1
  q[1] = 0.48860251190291992f * z; dq[1] = 0.48860251190291992f;
  q[2] = -0.48860251190291992f; dq[2] = 0;
#endif
#if DEGREE >= 2
  q[3] = 0.94617469575755997f * zz - 0.31539156525251999f; dq[3] = 1.89234939151512f * z;
  q[4] = -1.0925484305920792f * z; dq[4] = -1.0925484305920792f;
  q[5] = 0.54627421529603959f; dq[5] = 0;
#endif
#if DEGREE >= 3
  q[6] = z * (1.8658816629505771f * zz - 1.1195289977703462f); dq[6] = 5.5976449888517312f * zz - 1.1195289977703462f;
  q[7] = 0.45704579946446572f - 2.2852289973223288f * zz; dq[7] = -4.5704579946446572f * z;
  q[8] = 1.4453057213202769f * z; dq[8] = 1.4453057213202769f;
  q[9] = -0.59004358992664352f; dq[9] = 0;
#endif
#if DEGREE >= 4
  q[10] = (3.7024941420321507f * zz - 3.1735664074561294f) * zz + 0.31735664074561293f;
  dq[10] = z * (14.809976568128603f * zz - 6.3471328149122587f);
  q[11] = z * (2.0071396306718677f - 4.6833258049010247f * zz); dq[11] = 2.0071396306718677f - 14.049977414703074f * zz;
  q[12] = 3.3116114351514603f * zz - 0.47308734787878004f; dq[12] = 6.6232228703029206f * z;
  q[13] = -1.7701307697799304f * z; dq[13] = -1.7701307697799304f;
  q[14] = 0.62583573544917614f; dq[14] = 0;
#endif
}

/* C_m and S_m. */
static void sh_turns(float x, float y, float *c, float *s) {
  c[0] = 1;
  s[0] = 0;
  for (int m = 1; m <= DEGREE; m++) {
    c[m] = x * c[m - 1] - y * s[m - 1];
    s[m] = x * s[m - 1] + y * c[m - 1];
  }
}

/* All functions in one direction, given by a unit vector. */
static void sh_basis(float3 d, float *value) {
  float q[Q_AT(DEGREES, 0)], dq[Q_AT(DEGREES, 0)], c[DEGREES], s[DEGREES];
  sh_heights(d.z, q, dq);
  sh_turns(d.x, d.y, c, s);
  for (int l = 0; l <= DEGREE; l++)
    for (int m = 0; m <= l; m++) {
      value[l * l + l + m] = q[Q_AT(l, m)] * c[m];
      if (m > 0) value[l * l + l - m] = q[Q_AT(l, m)] * s[m];
    }
}

/* dL/d(x, y, z) from dL/dY of every function, before the direction's length is held at 1. */
static float3 sh_basis_grad(float3 d, const float *by_value) {
  float q[Q_AT(DEGREES, 0)], dq[Q_AT(DEGREES, 0)], c[DEGREES], s[DEGREES];
  sh_heights(d.z, q, dq);
  sh_turns(d.x, d.y, c, s);
  float3 g = 0;
  for (int l = 0; l <= DEGREE; l++)
    for (int m = 0; m <= l; m++) {
      const float even = by_value[l * l + l + m], odd = m > 0 ? by_value[l * l + l - m] : 0;
      g.z += dq[Q_AT(l, m)] * (even * c[m] + odd * s[m]);
      if (m == 0) continue;
      g.x += m * q[Q_AT(l, m)] * (even * c[m - 1] + odd * s[m - 1]);
      g.y += m * q[Q_AT(l, m)] * (odd * c[m - 1] - even * s[m - 1]);
    }
  return g;
}
