"""Batches of cameras: one frame each, and gradients summed over all of them.

A frame is drawn for each camera in turn; a device that is busy with one image gains nothing from a
second one beside it. What all cameras share, the splats, gets one gradient, summed in the order of
the cameras; what each has for itself stays apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.errors import ShapeError
from rift_cl.geometry import Camera
from rift_cl.splat.renderer import DepthKind, Frame, FrameGradients, Renderer
from rift_cl.splat.splats import Splats


@dataclass(frozen=True, eq=False)
class ViewGradients:
    """Gradients of a loss by what one camera has for itself; device arrays.

    Args:
        means2d: (N, 2) by the positions on its screen.
        means2d_abs: (N, 2) the sum over pixels of its magnitudes; None without ``absgrad``.
        camera: (16,) by pose and intrinsics; None if not asked for.
        aperture: (2,) by the aperture's radius and focus; None as well where there is none.
        background: by its background; None where there was none.
    """

    means2d: DeviceArray
    means2d_abs: DeviceArray | None
    camera: DeviceArray | None
    aperture: DeviceArray | None
    background: DeviceArray | None


@dataclass(frozen=True, eq=False)
class SplatSums:
    """Gradients of a loss by the splats' parameters, summed over cameras; see ``Splats``."""

    means: DeviceArray
    quats: DeviceArray | None
    scales: DeviceArray | None
    covars: DeviceArray | None
    opacities: DeviceArray
    colors: DeviceArray | None
    sh: DeviceArray | None
    shape_modes: DeviceArray | None
    color_modes: DeviceArray | None
    lobes: DeviceArray | None


def draw_views(
    renderer: Renderer,
    splats: Splats,
    cameras: Sequence[Camera],
    *,
    backgrounds: Sequence[DeviceArray] | None = None,
    depth: DepthKind | None = None,
) -> list[Frame]:
    """Render the same splats for every camera; see ``Renderer.forward``.

    Args:
        renderer: draws each of them.
        splats: parameters on the renderer's device.
        cameras: any number of views, of any sizes.
        backgrounds: one for each camera; black if not given.
        depth: as in ``Renderer.forward``.

    Raises:
        ShapeError: there are not as many backgrounds as cameras.
    """
    behind = [None] * len(cameras) if backgrounds is None else list(backgrounds)
    _check_count("backgrounds", behind, len(cameras))
    return [
        renderer.forward(splats, camera, background=background, depth=depth)
        for camera, background in zip(cameras, behind, strict=True)
    ]


def views_grad(
    renderer: Renderer,
    frames: Sequence[Frame],
    grad_images: Sequence[DeviceArray],
    grad_transmittances: Sequence[DeviceArray] | None = None,
    *,
    with_camera: bool = False,
) -> tuple[SplatSums, list[ViewGradients]]:
    """The gradient of a loss by everything that made some frames.

    Args:
        renderer: what drew them.
        frames: one or more frames of the same splats.
        grad_images: dL/d image of each.
        grad_transmittances: dL/d transmittance of each; zero if not given.
        with_camera: differentiate by poses, intrinsics and apertures as well.

    Returns:
        What the splats share, and what each camera has for itself.

    Raises:
        ShapeError: there are no frames, or not as many gradients as frames.
    """
    if not frames:
        raise ShapeError("views_grad: there are no frames, wanted one or more")
    thin = [None] * len(frames) if grad_transmittances is None else list(grad_transmittances)
    _check_count("grad_images", grad_images, len(frames))
    _check_count("grad_transmittances", thin, len(frames))
    total, views = None, []
    for frame, image, transmittance in zip(frames, grad_images, thin, strict=True):
        found = renderer.backward(frame, image, transmittance, with_camera=with_camera)
        total = _add(renderer.device, total, _shared(found))
        screen, lens = (found.splats.means2d, found.splats.means2d_abs), found.aperture
        views.append(ViewGradients(*screen, found.camera, lens, found.background))
    assert total is not None
    return total, views


def _shared(found: FrameGradients) -> SplatSums:
    splats = found.splats
    shape = (splats.quats, splats.scales, splats.covars)
    colors, modes = (found.colors, found.sh), (found.shape_modes, found.color_modes)
    return SplatSums(splats.means, *shape, splats.opacities, *colors, *modes, found.lobes)


def _add(device: Device, total: SplatSums | None, more: SplatSums) -> SplatSums:
    if total is None:
        return more
    for field in fields(total):
        array = getattr(total, field.name)
        if array is not None:
            axpby(device, 1.0, getattr(more, field.name), 1.0, array)
    return total


def _check_count(name: str, values: Sequence[Any], count: int) -> None:
    if len(values) != count:
        raise ShapeError(f"{name} has {len(values)} entries, wanted one for each of {count} views")
