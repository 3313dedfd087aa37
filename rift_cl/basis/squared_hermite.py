"""Densities that are never negative: the square of a Hermite expansion, still closed under rays.

rho(x) = Q(x)^2 exp(-|x|^2 / 2) with Q = sum_n a_n He_n(x) / sqrt(n!) is what the kernels call the
activation "square"; order 0 is the Gaussian. Its amplitude Q exp(-|x|^2 / 4) is a standard Hermite
expansion in x / sqrt(2) ("laser intensity"). As products of Hermite polynomials are sums of them,

    He_m He_n = sum_k k! C(m, k) C(n, k) He_(m+n-2k)        (Nielsen 1918),

rho is exactly an expansion of order 2 N in derivative form, so that projection, blur and transform
are those of ``Hermite``. Its integral is (2 pi)^(dim/2) |a|^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis import cull_radius, indices
from rift_cl.basis.hermite import Hermite
from rift_cl.basis.hermite_functions import Form
from rift_cl.basis.numbers import vectors, whole
from rift_cl.basis.protocol import Basis, Evaluation, Truncation
from rift_cl.errors import BasisSpanError

# Twice as much is the order of the expansion, to which its sums keep twelve digits.
MAX_SQUARED_ORDER = 8


@dataclass(frozen=True)
class SquaredHermite:
    """Squares of Hermite expansions; no linear basis: coefficients of two do not add up.

    Args:
        order: highest total order N of the amplitude, to 8.
        dim: of space.

    Raises:
        InputError: an argument is out of range.
    """

    order: int
    dim: int = 2
    truncation: Truncation = field(default="total", init=False, repr=False)
    form: Form = field(default="der", init=False, repr=False)
    name: ClassVar[str] = "squared_hermite"

    def __post_init__(self) -> None:
        """Check the settings."""
        whole(self.dim, "SquaredHermite: dim", 1, 3)
        hint = f": its square has order 2 N, held to {2 * MAX_SQUARED_ORDER}"
        whole(self.order, "SquaredHermite: order", 0, MAX_SQUARED_ORDER, hint)

    @property
    def n_coeff(self) -> int:
        """How many coefficients one function has."""
        return indices.n_coeff(self.order, self.dim)

    @property
    def expansion(self) -> Hermite:
        """The linear basis that holds the densities: order 2 N, derivative form."""
        return Hermite(2 * self.order, self.dim)

    def indices(self) -> NDArray[np.intp]:
        """(n_coeff, dim) of the amplitude, read-only."""
        return indices.graded(self.order, self.dim)

    def expand(self, coeff: ArrayLike) -> NDArray[np.float64]:
        """Amplitudes (..., n_coeff) to coefficients (..., K) of the density in ``expansion``.

        Raises:
            InputError: coefficients do not fit.
        """
        amplitude = self._cube(self._read(coeff), self.order)
        return self._contract("{a},{b},{sums}->{p}", amplitude, amplitude, 2 * self.order)

    @overload
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: Literal[False] = False
    ) -> NDArray[Any]: ...
    @overload
    def evaluate(self, coeff: ArrayLike, x: ArrayLike, grad: Literal[True]) -> Evaluation: ...
    def evaluate(
        self, coeff: ArrayLike, x: ArrayLike, grad: bool = False
    ) -> NDArray[Any] | Evaluation:
        """The density at points; arguments and errors of ``Span.evaluate``."""
        a, points = self._read(coeff), vectors(x, "x", self.dim)
        inner = Hermite(self.order, self.dim, "total", "std")
        psi = inner.evaluate(a * self._peak, points / math.sqrt(2), True)
        if not grad:
            return np.asarray(psi.value**2)
        twice = 2 * psi.value[..., None]
        return Evaluation(
            psi.value**2, twice * psi.dx / math.sqrt(2), twice * psi.dcoeff * self._peak
        )

    def convert(self, coeff: ArrayLike, to: Basis) -> NDArray[Any]:
        """The same density in a linear basis of order 2 N or more, or in larger squares.

        Raises:
            BasisSpanError: the other set does not hold all of this one.
            InputError: the form changes above order 12, or coefficients do not fit.
        """
        if not isinstance(to, SquaredHermite):
            return self.expansion.convert(self.expand(coeff), to)
        if to.dim != self.dim or to.order < self.order:
            raise BasisSpanError(
                f"{self} is not held by {to}; closed would be SquaredHermite({self.order}, "
                f"{self.dim}) or a higher order"
            )
        a = self._read(coeff)
        return np.concatenate([a, np.zeros((*a.shape[:-1], to.n_coeff - self.n_coeff))], -1)

    def project(self, coeff: ArrayLike, A: ArrayLike) -> NDArray[np.float64]:
        """Coefficients of the projected density in ``Hermite(2 N, out)``; never negative either.

        Raises:
            InputError: shapes do not fit, or a number is not finite.
        """
        return np.asarray(self.expansion.project(self.expand(coeff), A))

    def project_vjp(
        self, coeff: ArrayLike, A: ArrayLike, cotangent: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How a loss changes with amplitudes and A; arguments of ``projection.project_vjp``.

        Raises:
            InputError: shapes do not fit, or a number is not finite.
        """
        by_density, by_matrix = self.expansion.project_vjp(self.expand(coeff), A, cotangent)
        amplitude = self._cube(self._read(coeff), self.order)
        density = self._cube(by_density, 2 * self.order)
        return 2 * self._contract("{a},{p},{sums}->{b}", amplitude, density, self.order), by_matrix

    def fourier(self, coeff: ArrayLike, k: ArrayLike) -> NDArray[Any]:
        """Integral of rho(x) exp(-i k.x) dx; arguments and errors of ``Hermite.fourier``."""
        return self.expansion.fourier(self.expand(coeff), k)

    def rotate(self, coeff: ArrayLike, theta: ArrayLike) -> NDArray[np.float64]:
        """Amplitudes of rho(R^-1 x); arguments and errors of ``Hermite.rotate``."""
        return np.asarray(Hermite(self.order, self.dim).rotate(self._read(coeff), theta))

    def gram(self) -> NDArray[np.float64]:
        """The quadratic form a^T G a that is the integral of the density, (n_coeff, n_coeff)."""
        return np.asarray((2 * math.pi) ** (self.dim / 2) * np.eye(self.n_coeff))

    def cull_radius(self, coeff: ArrayLike, eps: float) -> NDArray[np.float64]:
        """Where to stop drawing; arguments and errors of ``Span.cull_radius``."""
        inner = Hermite(self.order, self.dim, "total", "std")
        root = math.sqrt(cull_radius.threshold(eps))
        far = inner.cull_radius(self._read(coeff) * self._peak, root)
        return np.asarray(math.sqrt(2) * far)

    @property
    def _peak(self) -> float:
        return float(math.pi ** (self.dim / 4))

    def _read(self, coeff: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(vectors(coeff, f"coeff of {self}", self.n_coeff))

    def _cube(self, values: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """Graded coefficients (..., K) on the grid of their indices, (..., order + 1, ...)."""
        cube = np.zeros((*values.shape[:-1], *[order + 1] * self.dim))
        cube[(..., *indices.graded(order, self.dim).T)] = values
        return cube

    def _contract(
        self, rule: str, left: NDArray[np.float64], right: NDArray[np.float64], order: int
    ) -> NDArray[np.float64]:
        """Sum two cubes over the product rule of every dimension; graded, up to ``order``."""
        a, b, p = ("..." + letters[: self.dim] for letters in ("abc", "def", "pqr"))
        sums = ",".join(["adp", "beq", "cfr"][: self.dim])
        rules = [linearisation(self.order)] * self.dim
        filled = rule.format(a=a, b=b, p=p, sums=sums)
        # First all rules into the left cube, one by one, and the right one at the end: the path
        # that NumPy would choose itself is a thousand times as long.
        path = [(0, 2), *[(1, 1 + rest) for rest in range(self.dim - 1, 0, -1)], (0, 1)]
        cube = np.einsum(filled, left, right, *rules, optimize=["einsum_path", *path])
        return np.asarray(cube[(..., *indices.graded(order, self.dim).T)])


@cache
def linearisation(order: int) -> NDArray[np.float64]:
    """He_m He_n in He_j, all over the roots of their factorials, (order+1, order+1, 2 order+1)."""
    table = np.zeros((order + 1, order + 1, 2 * order + 1))
    for m in range(order + 1):
        for n in range(order + 1):
            for k in range(min(m, n) + 1):
                j = m + n - 2 * k
                pairs = math.factorial(k) * math.comb(m, k) * math.comb(n, k)
                root = math.factorial(j) / (math.factorial(m) * math.factorial(n))
                table[m, n, j] = pairs * math.sqrt(root)
    table.flags.writeable = False
    return table
