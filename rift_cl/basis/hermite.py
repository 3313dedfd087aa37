"""Gaussians times Hermite polynomials, products over the dimensions: the basis of the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis import indices
from rift_cl.basis.fourier import transforms
from rift_cl.basis.hermite_functions import (
    Form,
    derivatives,
    functions,
    overlaps,
    products,
)
from rift_cl.basis.numbers import together, vectors, whole
from rift_cl.basis.projection import gamma_matrix
from rift_cl.basis.protocol import Truncation
from rift_cl.basis.rotation import rotation_matrix
from rift_cl.basis.span import Span, check_settings
from rift_cl.errors import BasisSpanError


@dataclass(frozen=True)
class Hermite(Span):
    """Hermite-Gaussian modes, prod_i e_(n_i)(x_i) or h_(n_i)(x_i) of ``hermite_functions``.

    Args:
        order: highest total order or row; to 64 in total order (a row set of order L reaches
            total order dim L). Splat kernels take orders to 8.
        dim: of space.
        truncation: ``total`` keeps sum(n) <= order, graded; ``row`` keeps max(n) <= order.
        form: ``der``, derivatives of the Gaussian, as splats are stored and drawn; or ``std``,
            orthonormal. Modes of order 0 are exp(-|x|^2 / 2), times pi^(-dim/4) if ``std``.

    Raises:
        InputError: an argument is out of range.
    """

    order: int
    dim: int = 2
    truncation: Truncation = "total"
    form: Form = "der"
    name: ClassVar[str] = "hermite"

    def __post_init__(self) -> None:
        """Check the settings."""
        whole(self.dim, f"{type(self).__name__}: dim", 1, 3)
        check_settings(self, type(self).__name__, self.dim)

    @property
    def reach(self) -> int:
        """The lowest total order up to which Hermite modes hold all of it."""
        return self.order * (self.dim if self.truncation == "row" else 1)

    def indices(self) -> NDArray[np.intp]:
        """(n_coeff, dim) orders along the axes, read-only."""
        if self.truncation == "total":
            return indices.graded(self.order, self.dim)
        return indices.rows(self.order, self.dim)

    def to_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """Own coefficients (..., n_coeff) to graded ones up to reach."""
        if self.truncation == "total":
            return coeff
        whole_set = np.zeros(
            (*coeff.shape[:-1], indices.n_coeff(self.reach, self.dim)), coeff.dtype
        )
        whole_set[..., indices.place(self.indices())] = coeff
        return whole_set

    def from_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """The adjoint of ``to_hermite``."""
        return coeff if self.truncation == "total" else coeff[..., indices.place(self.indices())]

    def fourier(self, coeff: ArrayLike, k: ArrayLike) -> NDArray[Any]:
        """Integral of f(x) exp(-i k.x) dx.

        Args:
            coeff: (..., n_coeff).
            k: (..., dim) angular frequencies, radians per whitened unit.

        Returns:
            (...) complex.

        Raises:
            InputError: shapes do not fit, or a number is not finite.
        """
        c, waves = self._read(coeff), vectors(k, "k", self.dim)
        together(c, waves, "k")
        modes = products(transforms(waves, self.order, self.form), self.indices())
        return np.asarray(np.einsum("...k,...k->...", modes, c))

    def rotate(self, coeff: ArrayLike, theta: ArrayLike) -> NDArray[Any]:
        """Coefficients of f(R^-1 x).

        Args:
            coeff: (..., n_coeff).
            theta: angle in radians, counter-clockwise; in 3D an orthogonal (3, 3) matrix R.

        Raises:
            BasisSpanError: a row set is not closed under rotation.
            InputError: coefficients do not fit, or there is nothing to turn.
        """
        c, turn = self._read(coeff), rotation_matrix(theta, self.dim)
        if self.truncation == "row" and self.order > 0:
            raise BasisSpanError(
                f"{self} is not closed under rotation; closed would be the total order "
                f"{self.reach}: convert to Hermite({self.reach}, {self.dim}, 'total') first"
            )
        return np.asarray(c @ gamma_matrix(turn, self.order).T)

    def gram(self) -> NDArray[np.float64]:
        """Integrals of the products of the modes, (n_coeff, n_coeff); 1 in the standard form."""
        if self.form == "std":
            return np.eye(self.n_coeff)
        modes = self.indices()
        return products(overlaps(self.order)[modes], modes)

    def _modes(self, x: NDArray[Any]) -> NDArray[Any]:
        return products(functions(x, self.order, self.form), self.indices())

    def _slopes(self, coeff: NDArray[Any], x: NDArray[Any]) -> NDArray[Any]:
        tables = functions(x, self.order + 1, self.form)
        steep = derivatives(tables, self.form)
        slopes = []
        for axis in range(self.dim):
            one = tables[..., :-1].copy()
            one[..., axis, :] = steep[..., axis, :]
            slopes.append(np.einsum("...k,...k->...", products(one, self.indices()), coeff))
        return np.stack(slopes, -1)
