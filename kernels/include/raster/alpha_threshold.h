/* The two thresholds of compositing, as 3D Gaussian Splatting (Kerbl et al. 2023) and gsplat have
 * them: a splat counts at a pixel where its alpha is at least ALPHA_THRESHOLD, and a pixel is
 * finished by the splat that would leave no more than TRANSMITTANCE_THRESHOLD of its transmittance. */

#define ALPHA_THRESHOLD (1.0f / 255.0f)
/* The optical depth that hides as much, -log(1 - ALPHA_THRESHOLD). */
#define DEPTH_THRESHOLD 0.0039292923f
/* Their logarithms to base 2: a plain Gaussian is judged by its exponent, before it is computed. */
#define ALPHA_THRESHOLD_LOG2 -7.99435344f
#define DEPTH_THRESHOLD_LOG2 -7.99152702f
#define TRANSMITTANCE_THRESHOLD 1e-4f
