/* Back from the moments that a raster gradient leaves of a splat to what its screen covariance is
 * made of, through dilation, blur and factor; splat_project_grad.cl says what the moments are. */

/* dL/d of V's rows, of M's rows, of ln factor, and of what blur adds to the variance. */
typedef struct {
  lanes3 v0, v1, m0, m1;
  lanes log_factor;
#if DEFOCUS
  lanes variance;
#endif
} ViewGradient;

#if DEFOCUS

/* Half the trace of Q S2 Q, and of Q for the factor. */
static lanes variance_grad(const Gaussian *g, const lanes *s, lanes log_factor) {
  const lanes q00 = conic_x(g, 1, 0), q01 = conic_y(g, 1, 0), q11 = conic_y(g, 0, 1);
  const lanes moments = s[3] * (q00 * q00 + q01 * q01) + s[5] * (q01 * q01 + q11 * q11)
      + 2 * s[4] * (q00 * q01 + q01 * q11);
  return -0.5f * (moments + log_factor * (q00 + q11));
}

#endif

/* What flows into V flows on to M. */
static void through_root(const Gaussian *g, ViewGradient *view) {
  view->m0 = applied(g->root, view->v0);
  view->m1 = applied(g->root, view->v1);
}

/* From the moments to the screen derivative M and root F, through dilation and factor. */
static ViewGradient dilate_grad(const Gaussian *g, const lanes *s) {
  ViewGradient out;
  out.log_factor = -s[0];
#if ANTIALIASED && !DEFOCUS
  out.log_factor = g->factor <= LEAST_COMPENSATION ? 0 : out.log_factor;
#endif
  /* adj(V V^T) V, and U. */
  const lanes3 a0 = cross_of(g->v1, g->normal), a1 = cross_of(g->normal, g->v0);
  const lanes3 u0 = times(g->inverse, plus(a0, times(g->eps, g->v0)));
  const lanes3 u1 = times(g->inverse, plus(a1, times(g->eps, g->v1)));
  const lanes3 w0 = plus(times(s[3], u0), times(s[4], u1));
  const lanes3 w1 = plus(times(s[4], u0), times(s[5], u1));
  out.v0 = lanes3_of(-conic_x(g, w0.x, w1.x), -conic_x(g, w0.y, w1.y), -conic_x(g, w0.z, w1.z));
  out.v1 = lanes3_of(-conic_y(g, w0.x, w1.x), -conic_y(g, w0.y, w1.y), -conic_y(g, w0.z, w1.z));
#if XRAY || ANTIALIASED || DEFOCUS
  out.v0 = minus(out.v0, times(out.log_factor, u0));
  out.v1 = minus(out.v1, times(out.log_factor, u1));
#endif
#if ANTIALIASED || DEFOCUS
  const lanes share = out.log_factor == 0 ? 0 : out.log_factor / g->kept;
  out.v0 = plus(out.v0, times(share, a0));
  out.v1 = plus(out.v1, times(share, a1));
#endif
#if DEFOCUS
  out.v0 = plus(out.v0, times(share * g->kept_eps, g->v0));
  out.v1 = plus(out.v1, times(share * g->kept_eps, g->v1));
  out.variance = variance_grad(g, s, out.log_factor);
#endif
  through_root(g, &out);
  return out;
}
