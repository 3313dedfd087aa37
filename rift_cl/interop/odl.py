"""ODL's operators as ours, and ours as ODL's.

    from rift_cl.interop.odl import from_odl, to_odl

    P = to_odl(A)                                     # between odl.rn spaces
    P = to_odl(A, domain=space)                       # from a uniform_discr, with its weights
    D = from_odl(odl.Gradient(space), device=A.device)

The spaces of functions that ODL discretizes weigh their inner products by the size of a cell, which
is smaller at the boundary if nodes lie on it. ``to_odl`` gives the adjoint that goes by these
weights; ``from_odl`` gives the transpose, without weights, as all of our operators have it. A power
of a space, as gradients map to, is an array with one axis more, which comes first.

Axis 0 of ODL's images is x; that of ours is y, or z. Arrays pass as they are, so that axis 0 of the
domain is y, unless ``to_odl(A, axes="xy")`` asks for elements as ODL's phantoms and plots are.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.real_type import working_type
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.geometry import Grid
from rift_cl.interop.optional_package import optional_package
from rift_cl.operators.host_operator import HostOperator
from rift_cl.operators.linear import LinearOperator

__all__ = ["from_odl", "to_odl"]

Weights = float | NDArray[np.float64]
Axes = Literal["yx", "xy"]
_ENDS = ("domain", "range")
# By how much of a spacing a space may sample an image elsewhere than the operator's grid does.
_OFF = 1e-3


def to_odl(A: LinearOperator, *, domain: Any = None, range: Any = None, axes: Axes = "yx") -> Any:
    """An operator as an ``odl.Operator``.

    Args:
        A: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.
        domain: a space of ODL's of shape ``A.domain``, which, if it discretizes functions, samples
            them where the operator's grid does; ``odl.rn`` of the operator's type if not given.
        range: the same of ``A.range``; its axes stay as they are: angles, rows, bins.
        axes: of an image, an element of the domain: ``yx``, as our arrays, (y, x) or (z, y, x);
            or ``xy``, as ODL has them, (x, y) or (x, y, z), of shape ``A.domain[::-1]``.

    Raises:
        DTypeError: A is no operator of this package, or a space is not of real numbers or its
            inner product is more than a weight for each sample.
        ShapeError: a space has another shape.
        InputError: ODL is not installed; the domain samples other places than the grid; or ``xy``
            is asked of an operator whose domain is not known to be an image.
    """
    odl = optional_package("odl", what="to_odl")
    if not isinstance(A, LinearOperator):
        raise DTypeError(f"A is a {type(A).__name__}, wanted a linear operator of rift_cl")
    if axes not in get_args(Axes):
        raise InputError(f"axes is {axes!r}, wanted one of {', '.join(get_args(Axes))}")
    grid = A.grid
    if axes == "xy":
        A = _with_x_first(A)
    spaces = [
        odl.rn(shape, dtype=A.dtype.name) if space is None else space
        for space, shape in ((domain, A.domain), (range, A.range))
    ]
    for name, space, shape in zip(_ENDS, spaces, (A.domain, A.range), strict=True):
        if tuple(space.shape) != shape:
            raise ShapeError(f"{name} has shape {tuple(space.shape)}, wanted {shape}")
        if _dtype(space).kind != "f":
            raise DTypeError(
                f"{name} is a space of {_dtype(space)}, wanted real numbers: our operators are "
                "real, and apply to real and imaginary parts one after the other"
            )
    if grid is not None:
        _check_places(spaces[0], grid, axes)
    weights = _weights("domain", spaces[0]), _weights("range", spaces[1])
    return _made(odl, A, tuple(spaces), weights)


def from_odl(P: Any, *, device: Device | None = None) -> LinearOperator:
    """A linear operator of ODL's as one of ours; it computes on the host.

    What ODL gives as adjoint is taken for one. That of some of its operators, as of
    ``odl.Resampling``, is an approximation: ``rift_cl.dot_test`` of the result tells.

    Args:
        P: an ``odl.Operator`` between real spaces of arrays, with an adjoint and one weight for
            all samples of a space: ODL's own operators keep no other.
        device: whose arrays the result takes as well; the default one if not given.

    Raises:
        DTypeError: P is no linear operator of ODL's between real spaces of one type and one weight
            each.
    """
    if not getattr(P, "is_linear", False) or not hasattr(P, "adjoint"):
        raise DTypeError(f"P is a {type(P).__name__}, wanted a linear operator of ODL")
    spaces = (P.domain, P.range)
    if not all(map(_is_array, spaces)):
        raise DTypeError(
            "P maps to or from a product of unlike spaces, wanted arrays: take one at a time"
        )
    weights = [_weight(f"the {n} of P", space) for n, space in zip(_ENDS, spaces, strict=True)]
    # ODL's adjoint holds between weighted products: P* = (w_range / w_domain) P'.
    back = weights[0] / weights[1]
    return HostOperator(
        lambda x: P(P.domain.element(x)).asarray(),
        lambda y: P.adjoint(P.range.element(y)).asarray() * back,
        tuple(P.domain.shape),
        tuple(P.range.shape),
        dtype=working_type(np.result_type(*map(_dtype, spaces)), name="P"),
        device=device,
    )


def _with_x_first(A: LinearOperator) -> LinearOperator:
    """The operator on images whose axes are x, y and z."""
    if A.grid is None:
        raise InputError(
            "axes is 'xy', and A does not say that its domain is an image: take that of a "
            "projector, and its adjoint by ODL"
        )
    return HostOperator(
        lambda x: A(x.T),
        lambda y: A.T(y).T,
        A.domain[::-1],
        A.range,
        dtype=A.dtype,
        device=A.device,
    )


def _check_places(space: Any, grid: Grid, axes: Axes) -> None:
    """Refuse a space of functions whose samples lie elsewhere than the operator's.

    Raises:
        InputError: they do, by the first axis that differs.
    """
    if not hasattr(space, "partition"):
        return
    order = list(enumerate("zyx"[-len(grid.shape) :]))
    for places, (axis, name) in zip(
        space.grid.coord_vectors, order if axes == "yx" else reversed(order), strict=True
    ):
        wanted, step = grid.coordinates(axis), grid.spacing[axis]
        if not np.allclose(places, wanted, rtol=0, atol=_OFF * step):
            low, high = wanted[0] - step / 2, wanted[-1] + step / 2
            raise InputError(
                f"domain samples {name} from {places[0]:g} to {places[-1]:g}, the operator's grid "
                f"from {wanted[0]:g} to {wanted[-1]:g}: let it reach from {low:g} to {high:g}, "
                "without nodes on the boundary, or give the grid its spacing and centre"
            )


def _made(
    odl: Any,
    A: LinearOperator,
    spaces: tuple[Any, Any],
    weights: tuple[Weights, Weights],
    scales: tuple[Weights, Weights] = (1.0, 1.0),
) -> Any:
    """``after A before`` between a domain and a range.

    Args:
        odl: the package.
        A: ours.
        spaces: domain and range.
        weights: of their inner products.
        scales: before and after, by which samples are multiplied.
    """
    before, after = scales

    class Applied(odl.Operator):  # type: ignore[misc]
        """``A`` between two spaces."""

        def __init__(self) -> None:
            super().__init__(*spaces, linear=True)

        def _call(self, x: Any) -> Any:
            return self.range.element(after * A(np.asarray(before * x.asarray(), A.dtype)))

        @property
        def adjoint(self) -> Any:
            """With the weights V of the domain and W of the range: ``V^-1 before A' after W``."""
            across = after * weights[1], before / weights[0]
            return _made(odl, A.T, spaces[::-1], weights[::-1], across)

    return Applied()


def _is_array(space: Any) -> bool:
    """Whether elements of a space are arrays: itself, or a power of one that is."""
    product = optional_package("odl", what="from_odl").ProductSpace
    if not isinstance(space, product):
        return hasattr(space, "dtype")
    return bool(len(space) and space.is_power_space and _is_array(space[0]))


def _weights(name: str, space: Any) -> Weights:
    """By what the inner product of a space weighs its samples: a number, or one for each."""
    weighting = getattr(space, "weighting", None)
    given = getattr(weighting, "array", getattr(weighting, "const", None))
    if given is None:
        raise DTypeError(
            f"{name} has a {type(weighting).__name__} as its inner product, wanted a weight for "
            "each sample"
        )
    if getattr(weighting, "exponent", 2.0) != 2.0:
        raise DTypeError(f"{name} has no inner product, wanted one with exponent 2")
    weights: NDArray[np.float64] = np.asarray(given, np.float64)
    if hasattr(space, "is_power_space"):
        # Each part has a weight, and weighs its own samples.
        weights = weights.reshape(*weights.shape, *[1] * (len(space.shape) - weights.ndim))
        return _plain(weights * _weights(name, space[0]))
    # As ODL's own inner product has it, cells that reach out of the partitioned set count in part.
    if getattr(space, "is_uniform", False) and not space.is_uniformly_weighted:
        weights = weights * _shares_inside(space)
    return _plain(weights)


def _shares_inside(space: Any) -> NDArray[np.float64]:
    """What share of each cell of a discretized space lies in its domain."""
    shares = np.ones(space.shape)
    for axis, (first, last) in enumerate(space.partition.boundary_cell_fractions):
        along = np.moveaxis(shares, axis, 0)
        along[0] *= first
        along[-1] *= last
    return shares


def _plain(weights: NDArray[np.float64]) -> Weights:
    """One number where all are alike."""
    alike = weights.size and (weights == weights.flat[0]).all()
    return float(weights.flat[0]) if alike else weights


def _weight(name: str, space: Any) -> float:
    """The constant by which a space weighs its inner product."""
    weights = _weights(name, space)
    if not isinstance(weights, float):
        raise DTypeError(
            f"{name} has a weight for each sample or part, wanted one for all: nodes_on_bdry=False "
            "gives that to a space that is discretized evenly"
        )
    return weights


def _dtype(space: Any) -> np.dtype[Any]:
    dtype: np.dtype[Any] = np.dtype(getattr(space, "dtype_identifier", None) or space.dtype)
    return dtype
