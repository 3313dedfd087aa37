"""What linear bases share: each spans a part of the Hermite modes up to some total order.

So conversion, projection and cull radii are done once, in the Hermite modes, and a basis has only
to say how its coefficients become those (an isometry, per form) and come back.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Literal, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis import cull_radius, projection
from rift_cl.basis.conversion import form_matrix
from rift_cl.basis.hermite_functions import Form
from rift_cl.basis.indices import n_coeff, order_slices
from rift_cl.basis.numbers import MAX_ORDER, numbers, together, vectors, whole
from rift_cl.basis.protocol import Basis, Evaluation, Truncation
from rift_cl.errors import BasisSpanError, InputError, ShapeError


class Span(ABC):
    """A basis whose functions are sums of its modes; ``protocol.Basis`` says what it can do."""

    order: int
    dim: int
    truncation: Truncation
    form: Form

    @property
    @abstractmethod
    def reach(self) -> int:
        """The lowest total order up to which Hermite modes hold all of it."""

    @abstractmethod
    def indices(self) -> NDArray[np.intp]:
        """Of the modes in the order of the coefficients, read-only."""

    @abstractmethod
    def to_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """Own coefficients (..., n_coeff) to graded Hermite ones of the same form up to reach."""

    @abstractmethod
    def from_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """The adjoint of ``to_hermite``, and for what lies in the span its inverse."""

    @abstractmethod
    def _modes(self, x: NDArray[Any]) -> NDArray[Any]: ...

    @abstractmethod
    def _slopes(self, coeff: NDArray[Any], x: NDArray[Any]) -> NDArray[Any]: ...

    @property
    def n_coeff(self) -> int:
        """How many coefficients one function has."""
        return len(self.indices())

    def modes(self, x: ArrayLike) -> NDArray[Any]:
        """Every mode at whitened positions x (..., dim): the matrix (..., n_coeff) of a fit.

        Raises:
            InputError: x has the wrong shape or is not finite.
        """
        return self._modes(vectors(x, "x", self.dim))

    @overload
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: Literal[False] = False
    ) -> NDArray[Any]: ...
    @overload
    def evaluate(self, coeff: ArrayLike, x: ArrayLike, grad: Literal[True]) -> Evaluation: ...
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: bool = False
    ) -> NDArray[Any] | Evaluation:
        """The function at points.

        Args:
            coeff: (..., n_coeff).
            x: (..., dim) whitened positions; leading axes of both broadcast.
            grad: give the derivatives as well.

        Raises:
            InputError: shapes do not fit, or a number is not finite.
        """
        c, points = self._read(coeff), vectors(x, "x", self.dim)
        together(c, points, "x")
        modes = self._modes(points)
        value = np.einsum("...k,...k->...", modes, c)
        if not grad:
            return np.asarray(value)
        return Evaluation(value, self._slopes(c, points), modes)

    def convert(self, coeff: ArrayLike, to: Basis) -> NDArray[Any]:
        """The same function in another basis.

        Args:
            coeff: (..., n_coeff).
            to: where to; complex Laguerre modes make the result complex.

        Returns:
            (..., to.n_coeff), exact.

        Raises:
            BasisSpanError: the other set does not hold all of this one.
            InputError: the form changes above order 12, or coefficients do not fit.
        """
        c = self._read(coeff)
        if not isinstance(to, Span):
            raise BasisSpanError(
                f"{self} cannot become {to}: wanted a linear basis, as Hermite({self.reach})"
            )
        self._demand_held_by(to)
        c = self._in_form(self.to_hermite(c), to.form)
        missing = n_coeff(to.reach, self.dim) - c.shape[-1]
        return to.from_hermite(np.concatenate([c, np.zeros((*c.shape[:-1], missing))], -1))

    def project(self, coeff: ArrayLike, A: ArrayLike) -> NDArray[Any]:
        """What is left of the function after integrating along rays, ``projection.project``.

        Args:
            coeff: (..., n_coeff).
            A: (..., out, dim), as ``footprint`` gives it.

        Returns:
            (..., K) coefficients of ``Hermite(reach, out)``: total order, derivative form.

        Raises:
            InputError: shapes do not fit, or the standard form reaches above order 12.
        """
        c = self._in_form(self.to_hermite(self._read(coeff)), "der")
        return projection.project(c, self._demand_view(A), self.reach)

    def project_vjp(
        self, coeff: ArrayLike, A: ArrayLike, cotangent: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """How a loss changes with coefficients and A; arguments of ``projection.project_vjp``.

        Raises:
            InputError: as for ``project``, or the basis or a number is complex.
        """
        c = self._in_form(self.to_hermite(self._read(coeff)), "der")
        if np.iscomplexobj(c):
            raise InputError(f"{self}: a gradient wants real coefficients, and kind='real'")
        by_c, by_matrix = projection.project_vjp(c, self._demand_view(A), self.reach, cotangent)
        if self.form == "std":
            by_c = by_c @ form_matrix(self.reach, self.dim, "std", "der")
        return self.from_hermite(by_c), by_matrix

    def cull_radius(self, coeff: ArrayLike, eps: float) -> NDArray[np.float64]:
        """Where to stop drawing.

        Args:
            coeff: (..., n_coeff).
            eps: positive threshold.

        Returns:
            (...) whitened distances beyond which |f| < eps, by the bound of ``cull_radius``.

        Raises:
            InputError: coefficients do not fit, or eps is not positive.
        """
        c = self.to_hermite(self._read(coeff))
        parts = order_slices(self.reach, self.dim)
        lengths = np.stack([np.hypot.reduce(np.abs(c[..., part]), -1) for part in parts], -1)
        return cull_radius.radius(lengths, cull_radius.threshold(eps), self.dim, self.form)

    def _read(self, coeff: ArrayLike) -> NDArray[Any]:
        return vectors(coeff, f"coeff of {self}", self.n_coeff, allow_complex=True)

    def _in_form(self, coeff: NDArray[Any], form: Form) -> NDArray[Any]:
        if form == self.form:
            return coeff
        return np.asarray(coeff @ form_matrix(self.reach, self.dim, self.form, form).T)

    def _demand_view(self, A: ArrayLike) -> NDArray[Any]:
        matrix = numbers(A, "A")
        if matrix.ndim < 2 or matrix.shape[-1] != self.dim:
            raise ShapeError(f"A has shape {matrix.shape}, wanted (..., out, {self.dim})")
        return matrix

    def _demand_held_by(self, to: Span) -> None:
        rows = type(to) is type(self) and self.truncation == to.truncation == "row"
        if to.dim == self.dim and (self.reach <= to.order or (rows and self.order <= to.order)):
            return
        own_rows = f", or its own row set to order {self.order}" if self.truncation == "row" else ""
        raise BasisSpanError(
            f"{self} reaches total order {self.reach} in {self.dim}D and {to} does not hold it; "
            f"closed would be any set to total order {self.reach} in {self.dim}D{own_rows}"
        )


def check_settings(basis: Span, name: str, row_reach: int) -> None:
    """See that order, truncation and form are what they can be; ``row_reach`` is reach per row.

    Raises:
        InputError: one of them is not.
    """
    most, hint = MAX_ORDER, ""
    if basis.truncation == "row" and row_reach > 1:
        most, hint = MAX_ORDER // row_reach, f": row s reaches total order {row_reach} s"
    whole(basis.order, f"{name}: order", 0, most, hint)
    for field, allowed in (("truncation", Truncation), ("form", Form)):
        value = getattr(basis, field)
        if value not in get_args(allowed):
            wanted = " or ".join(map(repr, get_args(allowed)))
            raise InputError(f"{name}: {field} is {value!r}, wanted {wanted}")
