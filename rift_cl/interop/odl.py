"""ODL's operators as ours, and ours as ODL's.

    from rift_cl.interop.odl import from_odl, to_odl

    P = to_odl(A)                                     # between odl.rn spaces
    P = to_odl(A, domain=space)                       # from a uniform_discr, with its weights
    D = from_odl(odl.Gradient(space), device=A.device)

The spaces of functions that ODL discretizes weigh their inner products by the size of a cell, which
is smaller at the boundary if nodes lie on it. ``to_odl`` gives the adjoint that goes by these
weights; ``from_odl`` gives the transpose, without weights, as all of our operators have it. A power
of a space, as gradients map to, is an array with one axis more, which comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import DTypeError, ShapeError
from rift_cl.interop.optional_package import optional_package
from rift_cl.operators.host_operator import HostOperator
from rift_cl.operators.linear import LinearOperator

__all__ = ["from_odl", "to_odl"]

Weights = float | NDArray[np.float64]
_ENDS = ("domain", "range")


def to_odl(A: LinearOperator, *, domain: Any = None, range: Any = None) -> Any:
    """An operator as an ``odl.Operator``.

    Args:
        A: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.
        domain: a space of ODL's of shape ``A.domain``; ``odl.rn`` of the operator's type if not
            given.
        range: the same of ``A.range``.

    Raises:
        DTypeError: A is no operator of this package, or a space is not of real numbers or its
            inner product is more than a weight for each sample.
        ShapeError: a space has another shape.
        InputError: ODL is not installed.
    """
    odl = optional_package("odl", what="to_odl")
    if not isinstance(A, LinearOperator):
        raise DTypeError(f"A is a {type(A).__name__}, wanted a linear operator of rift_cl")
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
        dtype=np.result_type(*(_dtype(space) for space in spaces)),
        device=device,
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
