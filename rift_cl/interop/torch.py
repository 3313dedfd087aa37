"""Splats in torch: tensors in, images out, gradients through autograd.

    from rift_cl.interop.torch import render

    images, alphas = render(means, quats, scales, opacities, viewmats, Ks, size=(h, w), sh=sh)
    loss(images).backward()

All settings of the rasterizer are available, line integrals of X-rays among them; poses and
intrinsics get gradients as well. For a training loop without torch see ``rift_cl.Renderer``,
which keeps everything on the device.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import torch

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.host_arrays import check_finite
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.camera import CameraModel, image_size
from rift_cl.interop.one_derivative import apply
from rift_cl.interop.raster_function import Parts, rasterize_flat
from rift_cl.interop.splat_functions import Drawer, Project, Shade
from rift_cl.interop.tensors import check_tensor, to_host
from rift_cl.splat.renderer import DepthKind, check_depth
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import check_opacities, check_scales

__all__ = ["Screens", "project", "rasterize", "render", "shade"]

# Alpha below which expected depth is not divided.
_LEAST_ALPHA = 1e-10


class Screens(NamedTuple):
    """N splats on the screens of V views; all but the last three pass gradients on.

    Args:
        means2d: (V, N, 2) positions in pixels.
        conics: (V, N, 3) the inverse covariances' a, b, c.
        weights: (V, N) opacity times compensation or, of X-rays, line integral.
        depths: (V, N) along the camera's axis; distances from a fisheye.
        extents: (V, N, 2) half the sides of the rectangle round a splat, in pixels.
        boxes: (V, N, 4) int32, the tiles it touches.
        culled: (V, N) uint8, 0 for the splats that are drawn, or an index into ``CULL_REASONS``.
    """

    means2d: torch.Tensor
    conics: torch.Tensor
    weights: torch.Tensor
    depths: torch.Tensor
    extents: torch.Tensor
    boxes: torch.Tensor
    culled: torch.Tensor


def drawer(
    size: tuple[int, int],
    *,
    model: CameraModel = "pinhole",
    settings: SplatSettings | None = None,
    device: Device | None = None,
) -> Drawer:
    """What all stages are told: image size, camera model, settings, OpenCL device."""
    settings = settings or SplatSettings()
    return Drawer(device or default_device(), settings, image_size(size), model)


def project(
    how: Drawer,
    means: torch.Tensor,
    quats: torch.Tensor | None,
    scales: torch.Tensor | None,
    opacities: torch.Tensor,
    viewmats: torch.Tensor,
    Ks: torch.Tensor,
    *,
    covars: torch.Tensor | None = None,
) -> Screens:
    """Project (N, 3) means with (N, 4) quats and (N, 3) scales, or (N, 6) covars, to V screens.

    Raises:
        ShapeError, DTypeError, DeviceError: a tensor does not fit the others.
        InputError: a camera cannot be used.
        NonFiniteError: a camera holds NaN or infinity.
    """
    check_tensor("means", means, (None, 3))
    count = means.shape[0]
    shapes = {"quats": (quats, 4), "scales": (scales, 3), "covars": (covars, 6)}
    given = [name for name, (tensor, _) in shapes.items() if tensor is not None]
    if given not in (["quats", "scales"], ["covars"]):
        raise InputError("give either quats and scales, or covars alone")
    for name in given:
        check_tensor(name, shapes[name][0], (count, shapes[name][1]), means)
    check_tensor("opacities", opacities, (count,), means)
    check_tensor("viewmats", viewmats, (None, 4, 4), means)
    check_tensor("Ks", Ks, (viewmats.shape[0], 3, 3), means)
    if viewmats.shape[0] == 0:
        raise ShapeError("viewmats has shape (0, 4, 4), wanted one view or more")
    tensors = (means, quats, scales, covars, opacities, viewmats, Ks)
    return Screens(*apply(Project, how, *tensors))


def shade(
    how: Drawer,
    means: torch.Tensor,
    sh: torch.Tensor,
    viewmats: torch.Tensor,
    Ks: torch.Tensor,
    culled: torch.Tensor,
) -> torch.Tensor:
    """Colours (V, N, 3) of (N, K, 3) or (V, N, K, 3) coefficients, K = 1, 4, 9, 16 or 25."""
    views, count = culled.shape
    each = isinstance(sh, torch.Tensor) and sh.dim() == 4
    shape = (*((views,) if each else ()), count, None, 3)
    check_tensor("sh", sh, shape, means)
    if sh.shape[-2] not in (1, 4, 9, 16, 25):
        raise ShapeError(f"sh has {sh.shape[-2]} coefficients, wanted 1, 4, 9, 16 or 25")
    tensors = (means, sh, viewmats, Ks, culled)
    colors: torch.Tensor = apply(Shade, how, *tensors)
    return colors


def rasterize(
    how: Drawer,
    screens: Screens,
    features: torch.Tensor,
    backgrounds: torch.Tensor | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw (V, N, D) features: images (V, height, width, D) and alphas (V, height, width, 1)."""
    if backgrounds is not None and how.settings.mode == "xray":
        raise InputError(
            "backgrounds have no meaning in xray mode, in which nothing lies behind: leave them out"
        )
    views, count = screens.culled.shape
    check_tensor("features", features, (views, count, None), screens.means2d)
    if backgrounds is not None:
        check_tensor("backgrounds", backgrounds, (views, features.shape[-1]), screens.means2d)
    flat = [screens.means2d, screens.conics, screens.weights, features]
    kept = [screens.depths.detach(), screens.extents, screens.boxes]
    tensors = [tensor.flatten(0, 1) for tensor in (*flat, *kept)]
    parts = Parts([count] * views, screens.means2d)
    images, alphas, *_ = rasterize_flat(how, parts, *tensors[:4], backgrounds, *tensors[4:])
    return images, alphas


def _check_values(given: dict[str, torch.Tensor | None], settings: SplatSettings) -> None:
    """Refuse what would leave out splats without a word, as a fit that diverges has them.

    Raises:
        NonFiniteError: a tensor holds NaN or infinity.
        InputError: scales or opacities are in the form that files hold, or densities below 0.
    """
    for name, tensor in given.items():
        if tensor is None or not tensor.numel():
            continue
        least, most = map(float, torch.aminmax(tensor.detach()))
        if not math.isfinite(most - least):
            check_finite(to_host(tensor), name=name)
        if name == "scales":
            check_scales(least)
        if name == "opacities":
            check_opacities(least, most, settings)


def render(
    means: torch.Tensor,
    quats: torch.Tensor | None,
    scales: torch.Tensor | None,
    opacities: torch.Tensor,
    viewmats: torch.Tensor,
    Ks: torch.Tensor,
    *,
    size: tuple[int, int],
    sh: torch.Tensor | None = None,
    colors: torch.Tensor | None = None,
    covars: torch.Tensor | None = None,
    backgrounds: torch.Tensor | None = None,
    depth: DepthKind | None = None,
    model: CameraModel = "pinhole",
    settings: SplatSettings | None = None,
    device: Device | None = None,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw N splats for V cameras, differentiable by everything but the sizes.

    Args:
        means: (N, 3) positions; all tensors are float32 and on one device of torch's.
        quats: (N, 4) rotations (w, x, y, z); None with ``covars``.
        scales: (N, 3) standard deviations, not their logarithms; a splat with a scale of 0 is not
            drawn and gets no gradient; None with ``covars``.
        opacities: (N,) opacities, 0 to 1 and not their logits, or densities in xray mode and
            optical depths with the activations ``exp`` and ``square``. A splat of density 0 is not
            drawn and gets no gradient, so that a fit has to begin above 0.
        viewmats: (V, 4, 4) world-to-camera matrices.
        Ks: (V, 3, 3) intrinsics in pixels.
        size: (height, width) of the images.
        sh: (N, K, 3) spherical harmonics.
        colors: (N, D) features; drawn after the harmonics' three colours if both are given.
        covars: (N, 6) upper triangles of covariances, in place of ``quats`` and ``scales``.
        backgrounds: (V, D) for all channels but depth; black if not given; not in xray mode.
        depth: draw depth as the last channel, ``accumulated`` or ``expected``.
        model: of the cameras.
        settings: of the rasterizer.
        device: the OpenCL device; the default one if not given.

    Returns:
        Images (V, height, width, D) and alphas (V, height, width, 1), which are 0 in xray mode. A
        gradient through them has no derivative: ``create_graph`` gives one that refuses it.

    Raises:
        NonFiniteError: a tensor holds NaN or infinity, of which a splat would not be drawn.
        RiftError: of the kind and with the sentence that say what does not fit.
    """
    how = drawer(size, model=model, settings=settings, device=device)
    check_depth(depth, how.settings)
    if depth == "median":
        raise InputError("the median depth has no gradient: rift_cl.splat.Renderer draws it")
    screens = project(how, means, quats, scales, opacities, viewmats, Ks, covars=covars)
    views, count = screens.culled.shape
    parts = []
    if sh is not None:
        parts.append(shade(how, means, sh, viewmats, Ks, screens.culled))
    if colors is not None:
        check_tensor("colors", colors, (count, None), means)
        parts.append(colors.expand(views, count, -1))
    given = {"means": means, "quats": quats, "scales": scales, "covars": covars}
    given |= {"opacities": opacities, "sh": sh, "colors": colors}
    _check_values(given, how.settings)
    if depth is not None:
        parts.append(screens.depths[..., None])
        backgrounds = with_depth(backgrounds)
    if not parts:
        raise InputError("nothing is drawn: give sh or colors, or ask for depth")
    images, alphas = rasterize(how, screens, torch.cat(parts, dim=-1), backgrounds)
    return (expect_depth(images, alphas) if depth == "expected" else images), alphas


def with_depth(backgrounds: Any) -> torch.Tensor | None:
    """Backgrounds with a zero for the channel of depth."""
    if not isinstance(backgrounds, torch.Tensor):
        return None if backgrounds is None else check_tensor("backgrounds", backgrounds, ())
    return torch.cat([backgrounds, torch.zeros_like(backgrounds[..., :1])], dim=-1)


def expect_depth(images: torch.Tensor, alphas: torch.Tensor) -> torch.Tensor:
    """Images whose last channel is divided by alpha."""
    expected = images[..., -1:] / alphas.clamp(min=_LEAST_ALPHA)
    return torch.cat([images[..., :-1], expected], dim=-1)
