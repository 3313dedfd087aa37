"""gsplat's ``rasterization`` on any OpenCL device: its signature, conventions and ``meta``.

    from rift_cl.interop.gsplat import rasterization        # was: from gsplat import rasterization

The signature is that of gsplat 1.5.3 (Apache-2.0); what differs:

- results are the same to the bit in every run;
- ``Ks`` gets a gradient, and so do ``viewmats`` of every camera model;
- ``alpha_cap`` (0.999 in gsplat 1.5.3, 0.99 in later versions) is a parameter, and ``device`` is
  the OpenCL device;
- poses must be rigid motions and intrinsics free of skew; bad input is a named error of
  ``rift_cl.errors`` (a ``ValueError``) where gsplat has an ``AssertionError``;
- ``segmented`` and ``channel_chunk`` are accepted and change nothing: any number of channels is
  drawn. Distribution, sparse gradients, the unscented transform, distortion and rolling shutter
  are not supported and say so.
"""

from __future__ import annotations

from typing import Any

import torch

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.interop.gsplat_stages import Scene, color_all, draw_all, project_all
from rift_cl.interop.tensors import check_tensor
from rift_cl.interop.torch import drawer
from rift_cl.splat.settings import SplatSettings

__all__ = ["rasterization"]

# The standard deviation of what gsplat's products of scales make flat; ours are positive.
_FLAT = 1e-20
_MODES = ("RGB", "D", "ED", "RGB+D", "RGB+ED")


def rasterization(
    means: torch.Tensor,
    quats: torch.Tensor,
    scales: torch.Tensor,
    opacities: torch.Tensor,
    colors: torch.Tensor,
    viewmats: torch.Tensor,
    Ks: torch.Tensor,
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = 1e10,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: bool = True,
    tile_size: int = 16,
    backgrounds: torch.Tensor | None = None,
    render_mode: str = "RGB",
    sparse_grad: bool = False,
    absgrad: bool = False,
    rasterize_mode: str = "classic",
    channel_chunk: int = 32,
    distributed: bool = False,
    camera_model: str = "pinhole",
    segmented: bool = False,
    covars: torch.Tensor | None = None,
    with_ut: bool = False,
    with_eval3d: bool = False,
    radial_coeffs: torch.Tensor | None = None,
    tangential_coeffs: torch.Tensor | None = None,
    thin_prism_coeffs: torch.Tensor | None = None,
    ftheta_coeffs: Any = None,
    rolling_shutter: Any = None,
    viewmats_rs: torch.Tensor | None = None,
    *,
    alpha_cap: float = 0.999,
    device: Device | None = None,
) -> tuple[torch.Tensor, torch.Tensor, dict[str, Any]]:
    """Draw N Gaussians for C cameras, with any batch dimensions in front of both.

    Args:
        means: (..., N, 3) centres.
        quats: (..., N, 4) rotations (w, x, y, z) of any length; ignored with ``covars``.
        scales: (..., N, 3) standard deviations, of either sign, 0 for what is flat; ignored with
            ``covars``.
        opacities: (..., N).
        colors: (..., [C,] N, D) colours or, with ``sh_degree``, (..., [C,] N, K, 3) coefficients.
        viewmats: (..., C, 4, 4) world-to-camera matrices.
        Ks: (..., C, 3, 3) intrinsics in pixels.
        width: of the images, in pixels.
        height: of the images, in pixels.
        near_plane: nearer Gaussians are left out.
        far_plane: farther Gaussians are left out.
        radius_clip: Gaussians with radii not larger than this are left out, in pixels.
        eps2d: variance that each gains on the screen, in square pixels.
        sh_degree: degree of the harmonics that are used, 0 to 4; None for plain colours.
        packed: ``meta`` holds visible Gaussians alone, (nnz, ...), in place of (..., C, N, ...).
        tile_size: 8, 16 or 32 pixels.
        backgrounds: (..., C, D).
        render_mode: ``RGB``, ``D`` (accumulated depth), ``ED`` (expected), ``RGB+D``, ``RGB+ED``.
        sparse_grad: not supported.
        absgrad: leave summed magnitudes in ``meta["means2d"].absgrad``.
        rasterize_mode: ``classic`` or ``antialiased``.
        channel_chunk: changes nothing.
        distributed: not supported.
        camera_model: ``pinhole``, ``ortho`` or ``fisheye``. Harmonics are those of the directions
            from where a camera stands, as in gsplat; our own ``ortho`` sees along its axis. Depths
            of a ``fisheye``, by which it sorts as well, are distances from it: gsplat takes z and
            leaves out what lies 90 degrees or more from the axis.
        segmented: changes nothing.
        covars: (..., N, 3, 3) covariances in place of ``quats`` and ``scales``.
        with_ut: not supported.
        with_eval3d: not supported.
        radial_coeffs: not supported: undistort the images first.
        tangential_coeffs: not supported.
        thin_prism_coeffs: not supported.
        ftheta_coeffs: not supported.
        rolling_shutter: not supported.
        viewmats_rs: not supported.
        alpha_cap: most that one Gaussian may hide.
        device: the OpenCL device; the default one if not given.

    Returns:
        Colours (..., C, height, width, X), alphas (..., C, height, width, 1), and ``meta``.

    Raises:
        ShapeError, DTypeError, DeviceError: a tensor does not fit the others.
        InputError: an option is unknown or not supported, or a camera cannot be used.
        ResourceLimitError: the images do not fit the memory budget in any number of bands.
    """
    _refuse(
        sparse_grad=sparse_grad,
        distributed=distributed,
        with_ut=with_ut,
        with_eval3d=with_eval3d,
        radial_coeffs=radial_coeffs,
        tangential_coeffs=tangential_coeffs,
        thin_prism_coeffs=thin_prism_coeffs,
        ftheta_coeffs=ftheta_coeffs,
        viewmats_rs=viewmats_rs,
        # gsplat's own default is an enumeration, whose name says "global".
        rolling_shutter=None if "GLOBAL" in str(rolling_shutter).upper() else rolling_shutter,
    )
    _check_options(render_mode, rasterize_mode)
    batch, (N, C) = means.shape[:-2], _counts(means, viewmats)
    given: dict[str, tuple[Any, tuple[int, ...]]] = {
        "means": (means, (N, 3)),
        "opacities": (opacities, (N,)),
        "viewmats": (viewmats, (C, 4, 4)),
        "Ks": (Ks, (C, 3, 3)),
    }
    if covars is None:
        given |= {"quats": (quats, (N, 4)), "scales": (scales, (N, 3))}
    else:
        given["covars"] = (covars, (N, 3, 3))
    flat = {
        name: check_tensor(name, value, (*batch, *shape), means).reshape(-1, *shape)
        for name, (value, shape) in given.items()
    }
    if covars is None:
        flat["scales"] = flat["scales"].abs().clamp_min(_FLAT)
    settings = SplatSettings(
        near=near_plane,
        far=far_plane,
        radius_clip=radius_clip,
        eps2d=eps2d,
        tile=tile_size,
        alpha_cap=alpha_cap,
        antialiased=rasterize_mode == "antialiased",
        absgrad=absgrad,
    )
    model: Any = camera_model
    how = drawer((height, width), model=model, settings=settings, device=device)
    scene = Scene(how, tuple(batch), flat)
    screens = project_all(scene)
    shown = color_all(scene, colors, screens, sh_degree) if "RGB" in render_mode else None
    return draw_all(scene, screens, shown, backgrounds, render_mode, packed=packed)


def _counts(means: Any, viewmats: Any) -> tuple[int, int]:
    for name, value, least in (("means", means, 2), ("viewmats", viewmats, 3)):
        if not isinstance(value, torch.Tensor) or value.dim() < least:
            check_tensor(name, value, (None,) * least)
    return means.shape[-2], viewmats.shape[-3]


def _refuse(**values: Any) -> None:
    """Refuse what gsplat has and this function knows by name alone."""
    for name, value in values.items():
        if value is not None and value is not False:
            raise InputError(f"{name} is not supported by rift_cl: leave it out")


def _check_options(render_mode: str, rasterize_mode: str) -> None:
    if render_mode not in _MODES:
        raise InputError(f"render_mode is {render_mode!r}, wanted one of {', '.join(_MODES)}")
    if rasterize_mode not in ("classic", "antialiased"):
        raise InputError(f"rasterize_mode is {rasterize_mode!r}, wanted classic or antialiased")
