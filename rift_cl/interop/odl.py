"""ODL's operators as ours, and ours as ODL's.

    from rift_cl.interop.odl import from_odl, to_odl

    P = to_odl(A)                                     # between odl.rn spaces
    P = to_odl(A, domain=space)                       # from a uniform_discr, with its weights
    D = from_odl(odl.Gradient(space), device=A.device)

The spaces of functions that ODL discretizes weigh their inner products by the size of a cell, and
ODL's adjoint goes by these. ``to_odl`` does as well; ``from_odl`` gives the transpose, without
weights, as all of our operators have it. A power of a space, as gradients map to, is an array with
one axis more, which comes first.
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


def to_odl(A: LinearOperator, *, domain: Any = None, range: Any = None) -> Any:
    """An operator as an ``odl.Operator``.

    Args:
        A: a projector, its adjoint, ``FilteredBackprojection``, any sum or product.
        domain: a space of ODL's of shape ``A.domain``; ``odl.rn`` of the operator's type if not
            given.
        range: the same of ``A.range``.

    Raises:
        DTypeError: A is no operator of this package.
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
    for name, space, shape in zip(("domain", "range"), spaces, (A.domain, A.range), strict=True):
        if tuple(space.shape) != shape:
            raise ShapeError(f"{name} has shape {tuple(space.shape)}, wanted {shape}")
    return _made(odl, A, *spaces, factor=1.0)


def from_odl(P: Any, *, device: Device | None = None) -> LinearOperator:
    """A linear operator of ODL's as one of ours; it computes on the host.

    Args:
        P: an ``odl.Operator`` between real spaces of arrays, with an adjoint.
        device: whose arrays the result takes as well; the default one if not given.

    Raises:
        DTypeError: P is no linear operator of ODL's between real spaces of one type.
    """
    if not getattr(P, "is_linear", False) or not hasattr(P, "adjoint"):
        raise DTypeError(f"P is a {type(P).__name__}, wanted a linear operator of ODL")
    spaces = (P.domain, P.range)
    if not all(map(_is_array, spaces)):
        raise DTypeError(
            "P maps to or from a product of unlike spaces, wanted arrays: take one at a time"
        )
    weights = [_weight(space) for space in spaces]
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


def _made(odl: Any, A: LinearOperator, domain: Any, range: Any, *, factor: float) -> Any:
    class Applied(odl.Operator):  # type: ignore[misc]
        """``factor * A x`` between two spaces."""

        def __init__(self) -> None:
            super().__init__(domain, range, linear=True)

        def _call(self, x: Any) -> Any:
            given: NDArray[Any] = np.asarray(x.asarray(), A.dtype)
            return self.range.element(factor * A(given) if factor != 1 else A(given))

        @property
        def adjoint(self) -> Any:
            """With the weights of both spaces."""
            weight = _weight(range) / _weight(domain)
            return _made(odl, A.T, range, domain, factor=factor * weight)

    return Applied()


def _is_array(space: Any) -> bool:
    """Whether elements of a space are arrays: itself, or a power of one that is."""
    product = optional_package("odl", what="from_odl").ProductSpace
    if not isinstance(space, product):
        return hasattr(space, "dtype")
    return bool(len(space) and space.is_power_space and _is_array(space[0]))


def _weight(space: Any) -> float:
    """The constant by which a space weighs its inner product."""
    weighting = getattr(space, "weighting", None)
    const = getattr(weighting, "const", getattr(weighting, "weight", 1.0))
    if np.ndim(const) or hasattr(weighting, "array"):
        raise DTypeError("a space has a weight for each sample or part, wanted one for all")
    if getattr(weighting, "exponent", 2.0) != 2.0:
        raise DTypeError("a space has no inner product, wanted one with exponent 2")
    parts = _weight(space[0]) if hasattr(space, "is_power_space") else 1.0
    return float(const) * parts


def _dtype(space: Any) -> np.dtype[Any]:
    dtype: np.dtype[Any] = np.dtype(getattr(space, "dtype_identifier", None) or space.dtype)
    return dtype
