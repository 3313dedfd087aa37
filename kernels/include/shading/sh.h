/* Real spherical harmonics to degree 4, with the signs of 3D Gaussian Splatting (Kerbl et al.).
 *
 * On the unit sphere each is Q_lm(z) times the real or imaginary part of (x + i y)^m, m >= 0:
 *
 *     Y[l^2 + l + m] = Q_lm(z) C_m(x, y),      Y[l^2 + l - m] = Q_lm(z) S_m(x, y)  for m > 0.
 *
 * Their derivatives follow from dC_m = m (C_m-1 dx - S_m-1 dy), dS_m = m (S_m-1 dx + C_m-1 dy).
 * COEFFICIENTS is (degree + 1)^2. Each lane has a direction of its own. */

#ifndef COEFFICIENTS
#define COEFFICIENTS 16
#endif
#define DEGREE (COEFFICIENTS >= 25 ? 4 : COEFFICIENTS >= 16 ? 3 : COEFFICIENTS >= 9 ? 2 : COEFFICIENTS >= 4 ? 1 : 0)
#define DEGREES (DEGREE + 1)
/* Where Q_lm stands among all of them. */
#define Q_AT(l, m) ((l) * ((l) + 1) / 2 + (m))

/* Q_lm and dQ_lm/dz. */
static void sh_heights(lanes z, lanes *q, lanes *dq) {
  const lanes zz = z * z;
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
  q[6] = z * (1.8658816629505771f * zz - 1.1195289977703462f);
  dq[6] = 5.5976449888517312f * zz - 1.1195289977703462f;
  q[7] = 0.45704579946446572f - 2.2852289973223288f * zz; dq[7] = -4.5704579946446572f * z;
  q[8] = 1.4453057213202769f * z; dq[8] = 1.4453057213202769f;
  q[9] = -0.59004358992664352f; dq[9] = 0;
#endif
#if DEGREE >= 4
  q[10] = (3.7024941420321507f * zz - 3.1735664074561294f) * zz + 0.31735664074561293f;
  dq[10] = z * (14.809976568128603f * zz - 6.3471328149122587f);
  q[11] = z * (2.0071396306718677f - 4.6833258049010247f * zz);
  dq[11] = 2.0071396306718677f - 14.049977414703074f * zz;
  q[12] = 3.3116114351514603f * zz - 0.47308734787878004f; dq[12] = 6.6232228703029206f * z;
  q[13] = -1.7701307697799304f * z; dq[13] = -1.7701307697799304f;
  q[14] = 0.62583573544917614f; dq[14] = 0;
#endif
}

/* C_m and S_m. */
static void sh_turns(lanes x, lanes y, lanes *c, lanes *s) {
  c[0] = 1;
  s[0] = 0;
  UNROLL for (int m = 1; m <= DEGREE; m++) {
    c[m] = x * c[m - 1] - y * s[m - 1];
    s[m] = x * s[m - 1] + y * c[m - 1];
  }
}

/* All functions in one direction, given by a unit vector. */
static void sh_basis(lanes3 d, lanes *value) {
  lanes q[Q_AT(DEGREES, 0)], dq[Q_AT(DEGREES, 0)], c[DEGREES], s[DEGREES];
  sh_heights(d.z, q, dq);
  sh_turns(d.x, d.y, c, s);
  UNROLL for (int l = 0; l <= DEGREE; l++)
    UNROLL for (int m = 0; m <= l; m++) {
      value[l * l + l + m] = q[Q_AT(l, m)] * c[m];
      if (m > 0) value[l * l + l - m] = q[Q_AT(l, m)] * s[m];
    }
}

/* dL/d(x, y, z) from dL/dY of every function, before the direction's length is held at 1. */
static lanes3 sh_basis_grad(lanes3 d, const lanes *by_value) {
  lanes q[Q_AT(DEGREES, 0)], dq[Q_AT(DEGREES, 0)], c[DEGREES], s[DEGREES], gx = 0, gy = 0, gz = 0;
  sh_heights(d.z, q, dq);
  sh_turns(d.x, d.y, c, s);
  UNROLL for (int l = 0; l <= DEGREE; l++)
    UNROLL for (int m = 0; m <= l; m++) {
      const lanes even = by_value[l * l + l + m], odd = m > 0 ? by_value[l * l + l - m] : even;
      if (m == 0) {
        gz += dq[Q_AT(l, m)] * even;
        continue;
      }
      gz += dq[Q_AT(l, m)] * (even * c[m] + odd * s[m]);
      gx += (float)m * q[Q_AT(l, m)] * (even * c[m - 1] + odd * s[m - 1]);
      gy += (float)m * q[Q_AT(l, m)] * (odd * c[m - 1] - even * s[m - 1]);
    }
  return lanes3_of(gx, gy, gz);
}
