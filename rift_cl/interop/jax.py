"""Operators and splats in JAX: arrays in, arrays out, gradients by ``custom_vjp``.

    from rift_cl.interop.jax import apply, render

    loss = lambda image: ((apply(A, image) - sinogram) ** 2).sum()
    gradient = jax.jit(jax.grad(loss))(image)

Work is done on the OpenCL device, by ``jax.pure_callback``, so that ``jit``, ``vmap`` and ``grad``
know these functions; numbers cross by way of the host. The gradient of an operator is its adjoint,
an operator like any other, so that gradients of gradients need nothing more. JAX has no place for
an error in the midst of a compiled function: shapes and types are checked before, and where a
number is not finite all that comes of it is NaN (``jax.debug_nans`` finds the place).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_host_array
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.interop.batches import apply_to_each
from rift_cl.interop.optional_package import optional_package
from rift_cl.operators.linear import LinearOperator
from rift_cl.splat.renderer import Frame, Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats, check_opacities, check_scales

__all__ = ["apply", "render"]

# Parameters of splats that may be given, and have gradients.
_PARAMETERS = ("means", "quats", "scales", "opacities", "sh", "colors", "covars")
Arrays = dict[str, Any]


def apply(A: LinearOperator, x: Any, *, name: str = "x") -> Any:
    """Apply a linear operator to a JAX array, or to each of a batch.

    Args:
        A: the operator: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.
        x: (..., *A.domain) array of the operator's type, ``A.dtype``, or a tracer of one; leading
            dimensions, if any, are a batch.
        name: what the caller calls ``x``, for the sentence of an error.

    Returns:
        (..., *A.range) array of the same type, through which reverse-mode gradients of any order
        pass.

    Raises:
        DTypeError: A is no operator, or x has another type.
        ShapeError: the last dimensions of x are not the operator's domain.
        InputError: JAX is not installed.
    """
    jax = optional_package("jax", what="rift_cl.interop.jax")
    if not isinstance(A, LinearOperator):
        raise DTypeError(f"A is a {type(A).__name__}, wanted a linear operator first, then {name}")
    given = x if hasattr(x, "dtype") else jax.numpy.asarray(x)
    _check(name, given, A.domain, A.dtype)
    if A.dtype == np.float64 and not jax.config.jax_enable_x64:
        raise DTypeError(
            "A is of type float64, and JAX rounds to float32: set jax_enable_x64, or make A in "
            "float32"
        )
    return _linear(jax, A)(given)


def render(
    splats: Mapping[str, Any],
    camera: Camera,
    *,
    background: ArrayLike | None = None,
    settings: SplatSettings | None = None,
    device: Device | None = None,
) -> tuple[Any, Any]:
    """Draw splats from one camera.

    Args:
        splats: float32 arrays by name, as in ``rift_cl.Splats``: means (N, 3), opacities (N,),
            quats (N, 4) and scales (N, 3), or covars (N, 6); sh (N, K, 3), colors (N, D) or both.
            Densities of xray mode are 0 or more; a splat of density 0 is not drawn and gets no
            gradient, so that a fit has to begin above 0.
        camera: whose image is drawn; gradients do not go to it.
        background: (D,) colour behind the splats, no tracer; black if not given; not in xray mode.
        settings: of the rasterizer.
        device: the OpenCL device; the default one if not given.

    Returns:
        The image (height, width, D) and alpha (height, width, 1), which is 0 in xray mode, through
        which gradients pass to all that is in ``splats``. Where a number of these is not finite
        all of both is NaN, and so are the gradients.

    Raises:
        RiftError: of the kind and with the sentence that say what does not fit: shapes and types
            always, scales and opacities out of their range where their values are known. Those of
            a tracer, under ``jit`` or ``grad``, are known when the compiled function runs, and JAX
            makes a ``jax.errors.JaxRuntimeError`` of the error, with that sentence in it; so
            it does where the device has no memory.
    """
    jax = optional_package("jax", what="rift_cl.interop.jax")
    unknown = [name for name in splats if name not in _PARAMETERS]
    if unknown:
        raise InputError(f"splats: {unknown[0]} is none of {', '.join(_PARAMETERS)}")
    given = {name: v if hasattr(v, "dtype") else jax.numpy.asarray(v) for name, v in splats.items()}
    for name, values in given.items():
        _check(name, values, tuple(values.shape), np.dtype(np.float32))
    if not {"means", "opacities"} <= given.keys():
        raise InputError("splats: wanted means and opacities among them")
    # Only shapes and types are looked at.
    Splats(**{"quats": None, "scales": None, **given})
    if "sh" not in given and "colors" not in given:
        raise InputError("nothing is drawn: give sh or colors")
    channels = (3 if "sh" in given else 0) + (given["colors"].shape[1] if "colors" in given else 0)
    renderer = Renderer(settings, device=device)
    known = {name: v for name, v in given.items() if not isinstance(v, jax.core.Tracer)}
    _check_ranges(_hosts(known), renderer.settings)
    drawing = _Drawing(renderer, camera, channels, background)
    image, alpha = drawing.function(jax)(given)
    return image, alpha


def _linear(jax: Any, A: LinearOperator) -> Any:
    """``A x`` as a function of JAX's, whose derivative is ``A.T``."""

    @jax.custom_vjp  # type: ignore[untyped-decorator]
    def linear(x: Any) -> Any:
        batch = x.shape[: x.ndim - len(A.domain)]
        result = jax.ShapeDtypeStruct((*batch, *A.range), A.dtype)
        return jax.pure_callback(partial(_finite_each, A), result, x, vmap_method="expand_dims")

    linear.defvjp(lambda x: (linear(x), None), lambda _, y: (_linear(jax, A.T)(y),))
    return linear


def _finite_each(A: LinearOperator, x: Any) -> NDArray[Any]:
    """``A x`` for each of a batch, NaN throughout where a number is not finite."""
    host = np.asarray(x)
    if np.isfinite(host).all():
        return apply_to_each(A, host)
    return np.full((*host.shape[: host.ndim - len(A.domain)], *A.range), np.nan, A.dtype)


class _Drawing:
    """Splats from one camera, and the gradient of it.

    Args:
        renderer: draws.
        camera: whose image it is.
        channels: of the image.
        background: behind the splats, (D,), or None.
    """

    def __init__(
        self, renderer: Renderer, camera: Camera, channels: int, background: ArrayLike | None
    ) -> None:
        self._renderer, self._camera = renderer, camera
        self._shape = (*camera.size, channels)
        self._behind = None
        if background is not None:
            if renderer.settings.mode == "xray":
                raise InputError("background has no meaning in xray mode: leave it out")
            behind = as_host_array(background, (channels,), name="background", wants="the image")
            self._behind = renderer.device.array(behind)

    def function(self, jax: Any) -> Any:
        """From arrays by name to the image and alpha."""

        @jax.custom_vjp  # type: ignore[untyped-decorator]
        def drawn(splats: Arrays) -> Any:
            shapes = (self._shape, (*self._shape[:2], 1))
            results = tuple(jax.ShapeDtypeStruct(shape, np.float32) for shape in shapes)
            return jax.pure_callback(self._draw, results, splats, vmap_method="sequential")

        def back(splats: Arrays, incoming: tuple[Any, Any]) -> tuple[Arrays]:
            results = {n: jax.ShapeDtypeStruct(v.shape, np.float32) for n, v in splats.items()}
            found = jax.pure_callback(
                self._gradients, results, splats, *incoming, vmap_method="sequential"
            )
            return (found,)

        drawn.defvjp(lambda splats: (drawn(splats), splats), back)
        return drawn

    def _frame(self, hosts: Arrays) -> Frame:
        _check_ranges(hosts, self._renderer.settings)
        placed = Splats.upload(self._renderer.device, **hosts)
        return self._renderer.forward(placed, self._camera, background=self._behind)

    def _draw(self, splats: Arrays) -> tuple[NDArray[Any], NDArray[Any]]:
        hosts, device = _hosts(splats), self._renderer.device
        if not _finite(*hosts.values()):
            alpha = np.full((*self._shape[:2], 1), np.nan, np.float32)
            return np.full(self._shape, np.nan, np.float32), alpha
        frame = self._frame(hosts)
        return device.get(frame.image), 1 - device.get(frame.transmittance)[..., None]

    def _gradients(self, splats: Arrays, image: Any, alpha: Any) -> Arrays:
        hosts, device = _hosts(splats), self._renderer.device
        if not _finite(*hosts.values(), image, alpha):
            return {name: np.full(v.shape, np.nan, np.float32) for name, v in hosts.items()}
        found = self._renderer.backward(
            self._frame(hosts),
            device.array(np.asarray(image), np.float32),
            device.array(-np.asarray(alpha)[..., 0], np.float32),
            with_background=False,
            retain=False,
        )
        by_name: Arrays = {name: getattr(found, name, None) for name in ("sh", "colors")}
        by_name |= {name: getattr(found.splats, name, None) for name in _PARAMETERS[:4]}
        by_name["covars"] = found.splats.covars
        return {name: device.get(by_name[name]) for name in splats}


def _hosts(splats: Arrays) -> Arrays:
    return {name: np.asarray(values) for name, values in splats.items()}


def _finite(*arrays: Any) -> bool:
    return all(np.isfinite(np.asarray(array)).all() for array in arrays)


def _check_ranges(hosts: Arrays, settings: SplatSettings) -> None:
    """Check scales and opacities as far as they are given; what is not finite is passed over."""
    ends = {
        name: [float(end.reduce(hosts[name], axis=None)) for end in (np.fmin, np.fmax)]
        for name in ("scales", "opacities")
        if name in hosts and hosts[name].size
    }
    if "scales" in ends:
        check_scales(ends["scales"][0])
    if "opacities" in ends:
        least, most = ends["opacities"]
        check_opacities(least, most, settings)


def _check(name: str, x: Any, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    if x.dtype != dtype:
        raise DTypeError(
            f"{name} is an array of {x.dtype}, wanted {dtype}: call .astype({dtype.name!r})"
        )
    if tuple(x.shape[max(0, x.ndim - len(shape)) :]) != shape:
        wanted = ", ".join(map(str, shape))
        raise ShapeError(f"{name} has shape {tuple(x.shape)}, wanted (..., {wanted})")
