"""Back from observations of points to the cameras that made them: the chain rule."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rift_cl.geometry import Camera
from rift_cl.sampling.targets.observations import (
    Floats,
    Observations,
    ObservationsGradient,
    coarser_focal,
)


class CameraGradients(NamedTuple):
    """Derivatives of a number by what V cameras are; zero for what a camera does not have.

    Args:
        position: (V, 3) by the camera's centre, while it keeps its orientation. For a camera that
            turns so as to keep a point in its middle, the derivative is the same where that is
            the only point that counts.
        focal: (V,) by the focal length fx in pixels, aperture unchanged.
        radius: (V,) by the aperture's radius.
        focus: (V,) by the distance of the plane in focus.
        weight: (V,) by the view's weight.
    """

    position: Floats
    focal: Floats
    radius: Floats
    focus: Floats
    weight: Floats


def camera_gradients(
    cameras: Sequence[Camera], observations: Observations, gradient: ObservationsGradient
) -> CameraGradients:
    """Chain derivatives by observations with those of observations by cameras.

    Whether a point is in a picture is taken as given: a criterion jumps where one leaves it.

    Args:
        cameras: V of them.
        observations: how they see the points when all weights are 1.
        gradient: by the observations.
    """
    found = [_one(camera, observations, gradient, view) for view, camera in enumerate(cameras)]
    position, focal, radius, focus = (np.array(parts) for parts in zip(*found, strict=True))
    weight = (gradient.weight * observations.weight).sum(1)
    return CameraGradients(position, focal, radius, focus, weight)


def _one(
    camera: Camera, observations: Observations, gradient: ObservationsGradient, view: int
) -> tuple[Floats, float, float, float]:
    """Of one camera: by position (3,), focal length, radius, focus."""
    focal, pixel = coarser_focal(camera), observations.pixel[view]
    # How far away a point counts as, which is a pixel's edge times the focal length.
    reach = pixel * focal
    by_pixel, by_blur = gradient.pixel[view], gradient.blur[view]
    by_reach, radius, focus = by_pixel / focal, 0.0, 0.0
    if camera.aperture is not None:
        opening, plane = camera.aperture.radius, camera.aperture.focus
        side = 2 * opening * np.sign(1 - reach / plane) * by_blur
        radius, focus = float(by_blur @ observations.blur[view]), float(side @ reach) / plane**2
        by_reach = by_reach - side / plane
        if camera.aperture.wavelength > 0:
            by_cutoff = gradient.cutoff[view] * observations.cutoff[view]
            radius += float(by_cutoff.sum())
            by_reach = by_reach - by_cutoff / reach
        radius /= opening
    position = _by_position(camera, observations, gradient.direction[view], by_reach, view)
    return position, -float(by_pixel @ pixel) / focal, radius, focus


def _by_position(
    camera: Camera, observations: Observations, by_direction: Floats, by_reach: Floats, view: int
) -> Floats:
    if camera.model == "ortho":
        return np.zeros(3)
    direction = observations.direction[view]
    if camera.model == "pinhole":
        ahead = direction @ -camera.view[2, :3]
        # Points beside and behind are not seen, so that nothing hangs on how far off they are.
        distance = observations.pixel[view] * coarser_focal(camera) / np.where(ahead > 0, ahead, 1)
        farther = np.broadcast_to(-camera.view[2, :3], direction.shape)
    else:
        distance, farther = observations.pixel[view] * coarser_focal(camera), direction
    across = by_direction - (by_direction * direction).sum(1, keepdims=True) * direction
    return np.asarray((across / distance[:, None] + by_reach[:, None] * farther).sum(0))
