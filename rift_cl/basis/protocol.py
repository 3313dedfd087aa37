"""What every spatial basis can do, and what its evaluation gives."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis.hermite_functions import Form

Truncation = Literal["total", "row"]


class Evaluation(NamedTuple):
    """A function at points, and how it changes.

    Args:
        value: (...).
        dx: (..., dim) derivative by the whitened position.
        dcoeff: (..., n_coeff) derivative by the coefficients.
    """

    value: NDArray[Any]
    dx: NDArray[Any]
    dcoeff: NDArray[Any]


class Basis(Protocol):
    """A set of functions about the origin, of unit width; coefficients (..., n_coeff) choose one.

    Positions x are whitened, x' = M^-1 (x - mean) for a splat of covariance M M^T.
    """

    @property
    def name(self) -> str:
        """By which the basis is asked for."""

    @property
    def dim(self) -> int:
        """Of space, 1 to 3."""

    @property
    def order(self) -> int:
        """Highest total order, or highest row."""

    @property
    def truncation(self) -> Truncation:
        """Whether the set goes up to a total order or up to a row."""

    @property
    def form(self) -> Form:
        """Whether modes are normalised as derivatives of a Gaussian or to be orthonormal."""

    @property
    def n_coeff(self) -> int:
        """How many coefficients one function has."""

    def indices(self) -> NDArray[np.intp]:
        """Of the modes in the order of the coefficients, read-only."""

    @overload
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: Literal[False] = False
    ) -> NDArray[Any]: ...
    @overload
    def evaluate(self, coeff: ArrayLike, x: ArrayLike, grad: Literal[True]) -> Evaluation: ...
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: bool = False
    ) -> NDArray[Any] | Evaluation:
        """The function at x (..., dim); leading axes of both broadcast."""

    def convert(self, coeff: ArrayLike, to: Basis) -> NDArray[Any]:
        """The same function in another basis, exactly, or a BasisSpanError."""

    def project(self, coeff: ArrayLike, A: ArrayLike) -> NDArray[Any]:
        """Coefficients of the projection, in derivative form; ``projection`` says of what."""

    def project_vjp(
        self, coeff: ArrayLike, A: ArrayLike, cotangent: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """How a loss changes with ``coeff`` and A, from how it changes with the projection."""

    def fourier(self, coeff: ArrayLike, k: ArrayLike) -> NDArray[Any]:
        """Integral of f(x) exp(-i k.x) dx at whitened angular frequencies k (..., dim)."""

    def rotate(self, coeff: ArrayLike, theta: ArrayLike) -> NDArray[Any]:
        """Coefficients of the function turned by an angle, or in space by a matrix."""

    def gram(self) -> NDArray[Any]:
        """Integrals of the products of the modes, (n_coeff, n_coeff)."""

    def cull_radius(self, coeff: ArrayLike, eps: float) -> NDArray[np.float64]:
        """Whitened distance (...) beyond which the function stays below ``eps``."""
