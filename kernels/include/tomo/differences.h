/* Forward differences of an image or volume, and their adjoint.
 *
 * (D x)_a[i] = (x[i + e_a] - x[i]) / h_a, and 0 at the last sample along axis a: nothing is known
 * beyond the border, and nothing is assumed. The adjoint sums what every sample gave:
 * (D' u)[i] = sum over a of (u_a[i - e_a] - u_a[i]) / h_a, with u_a = 0 at the last sample.
 *
 * A field u holds one image per axis, z first (AXES 3) or y first (AXES 2), each of `size` samples.
 *
 * A directional variation is that of M D x, M a symmetric matrix on the components along y and x at
 * every sample, the same at all; the component along z stays as it is. Its adjoint is D' M u. */

#ifndef AXES
#define AXES 2
#endif
#ifndef DIRECTIONAL
#define DIRECTIONAL 0
#endif

/* A sample's place in a volume of (nz, ny, nx), and the step to the next one along each axis. */
typedef struct {
  long at, size;
  int index[3], last[3];
  long step[3];
} Place;

static Place place_of(int x, int y, int z, int nz, int ny, int nx) {
  Place p;
  p.at = ((long)z * ny + y) * nx + x;
  p.size = (long)nz * ny * nx;
  p.index[0] = z, p.index[1] = y, p.index[2] = x;
  p.last[0] = nz - 1, p.last[1] = ny - 1, p.last[2] = nx - 1;
  p.step[0] = (long)ny * nx, p.step[1] = nx, p.step[2] = 1;
  return p;
}

/* D x at a place along axis a, times h_a; axes are counted as in (z, y, x). */
static real difference(__global const real *x, const Place *p, int a) {
  return p->index[a] < p->last[a] ? x[p->at + p->step[a]] - x[p->at] : 0;
}

/* The share of axis a in D' u at a place, times h_a. */
static real difference_adjoint(__global const real *u, const Place *p, int a) {
  const real behind = p->index[a] > 0 ? u[p->at - p->step[a]] : 0;
  return p->index[a] < p->last[a] ? behind - u[p->at] : behind;
}

/* M v for a vector of AXES components. */
static void weigh_direction(real *v, real m_yy, real m_yx, real m_xx) {
  const real y = v[AXES - 2], x = v[AXES - 1];
  v[AXES - 2] = m_yy * y + m_yx * x;
  v[AXES - 1] = m_yx * y + m_xx * x;
}
