/* The two thresholds of compositing, as 3D Gaussian Splatting (Kerbl et al. 2023) and gsplat have
 * them: a splat counts at a pixel where its alpha is at least ALPHA_THRESHOLD, and a pixel is
 * finished by the splat that would leave no more than TRANSMITTANCE_THRESHOLD of its transmittance. */

#define ALPHA_THRESHOLD (1.0f / 255.0f)
#define TRANSMITTANCE_THRESHOLD 1e-4f
