"""What projection gives: splats on the screen, and gradients by all that was projected."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.array import DeviceArray

# The meaning of the codes in ``Projected.culled``.
CULL_REASONS = (
    "visible",
    "out of depth",
    "not finite or degenerate",
    "too faint",
    "off screen",
    "clipped for its radius",
)


@dataclass(frozen=True, eq=False)
class Projected:
    """N splats as the camera sees them; device arrays.

    Args:
        screen: (N, 8): mean x, mean y, conic a, b, c, weight, extent x, extent y; pixels. Weight
            is opacity times a factor: 1, or Mip-Splatting's compensation, or in xray mode the
            line integral through a unit peak; times what keeps the light that an aperture
            spreads. What is drawn of it in light mode lacks the share (1/255) / weight, as alphas
            below 1/255 do not count: much where a small splat is spread far. Extents are half the
            sides of the rectangle round all that is drawn of a splat.
        depths: (N,) distances along the camera's axis, in scene units.
        boxes: (N, 4) int32 tile rectangles (x0, y0, x1, y1), x1 and y1 exclusive.
        culled: (N,) uint8, an index into ``CULL_REASONS``; splats with another code than 0 have
            zeros everywhere.
    """

    screen: DeviceArray
    depths: DeviceArray
    boxes: DeviceArray
    culled: DeviceArray


@dataclass(frozen=True, eq=False)
class SplatGradients:
    """Gradients of a loss by everything that was projected; device arrays.

    Args:
        means, quats, scales, covars, opacities: as in ``Splats``; None where it has None.
        features: (N, D) gradient by what was drawn in each channel.
        means2d: (N, 2) gradient by the position on the screen, in 1 / pixels.
        means2d_abs: (N, 2) the sum over pixels of its magnitudes; None without ``absgrad``.
        camera: (N, 16) each splat's part in the gradient by the camera, for ``sum_columns``:
            the upper 3 rows of the view matrix, then fx, fy, cx, cy; None if not asked for.
        aperture: (N, 2) each splat's part in the gradient by the aperture's radius and focus;
            None as with the camera, and for a camera without aperture.
    """

    means: DeviceArray
    quats: DeviceArray | None
    scales: DeviceArray | None
    covars: DeviceArray | None
    opacities: DeviceArray
    features: DeviceArray
    means2d: DeviceArray
    means2d_abs: DeviceArray | None
    camera: DeviceArray | None
    aperture: DeviceArray | None = None
