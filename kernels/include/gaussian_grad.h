/* Back from the moments that a raster gradient leaves of a splat to what its screen covariance is
 * made of, through dilation, blur and factor; splat_project_grad.cl says what the moments are. */

/* dL/d of V's rows, of M's rows, of ln factor, and of what blur adds to the variance. */
typedef struct {
  float3 v0, v1, m0, m1;
  float log_factor;
#if DEFOCUS
  float variance;
#endif
} ViewGradient;

#if DEFOCUS

/* Half the trace of Q S2 Q, and of Q for the factor. */
static float variance_grad(const Gaussian *g, const float *s, float log_factor) {
  const float2 q0 = apply_conic(g, (float2)(1, 0)), q1 = apply_conic(g, (float2)(0, 1));
  const float moments = s[3] * (q0.x * q0.x + q1.x * q1.x) + s[5] * (q0.y * q0.y + q1.y * q1.y)
      + 2 * s[4] * (q0.x * q0.y + q1.x * q1.y);
  return -0.5f * (moments + log_factor * (q0.x + q1.y));
}

#endif

/* From the moments to the screen derivative M and root F, through dilation and factor. */
static ViewGradient dilate_grad(const Gaussian *g, const float *s) {
  ViewGradient out;
  out.log_factor = ANTIALIASED && !DEFOCUS && g->factor <= LEAST_COMPENSATION ? 0 : -s[0];
  /* adj(V V^T) V, and U. */
  const float3 a0 = cross3(g->v1, g->normal), a1 = cross3(g->normal, g->v0);
  const float3 u0 = (a0 + g->eps * g->v0) * g->inverse, u1 = (a1 + g->eps * g->v1) * g->inverse;
  const float3 w0 = s[3] * u0 + s[4] * u1, w1 = s[4] * u0 + s[5] * u1;
  const float2 x = apply_conic(g, (float2)(w0.x, w1.x));
  const float2 y = apply_conic(g, (float2)(w0.y, w1.y));
  const float2 z = apply_conic(g, (float2)(w0.z, w1.z));
  out.v0 = -(float3)(x.x, y.x, z.x);
  out.v1 = -(float3)(x.y, y.y, z.y);
#if XRAY || ANTIALIASED || DEFOCUS
  out.v0 -= out.log_factor * u0;
  out.v1 -= out.log_factor * u1;
#endif
#if ANTIALIASED || DEFOCUS
  const float share = out.log_factor == 0 ? 0 : out.log_factor / g->kept;
  out.v0 += share * a0;
  out.v1 += share * a1;
#endif
#if DEFOCUS
  out.v0 += share * g->kept_eps * g->v0;
  out.v1 += share * g->kept_eps * g->v1;
  out.variance = variance_grad(g, s, out.log_factor);
#endif
  out.m0 = apply3(g->root, out.v0);
  out.m1 = apply3(g->root, out.v1);
  return out;
}
