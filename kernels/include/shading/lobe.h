/* The functions of lobes: a constant, and after it those of the kind that LOBES says.
 *
 * FUNCTIONS counts all of them; GEOMETRY is how many numbers a splat's lobes have. A geometry with
 * a number that is not finite, or with a quaternion or an axis of no direction, has no functions.
 * A splat's geometry comes as GEOMETRY vectors, one for each number of eight splats. Needs portable.h. */

#define HG 0
#define LG 1
#define SG 2
#define ASG 3

#ifndef LOBES
#define LOBES HG
#endif
#ifndef FUNCTIONS
#define FUNCTIONS 8
#endif
#define MODES (FUNCTIONS - 1)
/* The harmonic of degree 0. */
#define CONSTANT 0.28209479177387814f

#include "include/shading/lobe_frame.h"
#if LOBES == HG || LOBES == LG
#include "include/shading/lobe_modes.h"
#include "include/shading/lobe_chart.h"
#else
#include "include/shading/lobe_gaussians.h"
#endif
