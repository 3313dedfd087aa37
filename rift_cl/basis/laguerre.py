"""Gaussians times Laguerre polynomials: modes of the plane with a number of turns of the phase."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis import indices
from rift_cl.basis.conversion import laguerre_matrices
from rift_cl.basis.hermite import Hermite
from rift_cl.basis.hermite_functions import Form
from rift_cl.basis.indices import Kind
from rift_cl.basis.laguerre_functions import functions
from rift_cl.basis.protocol import Truncation
from rift_cl.basis.rotation import rotation_matrix, turned
from rift_cl.basis.span import Span, check_settings
from rift_cl.errors import InputError


@dataclass(frozen=True)
class Laguerre(Span):
    """Laguerre-Gaussian modes of ``laguerre_functions``.

    Up to a total order 2 p + |l| they span what the Hermite modes do; turning them is diagonal.

    Args:
        order: highest total order (to 64) or row (to 32; row L reaches total order 2 L).
        kind: ``real`` (cosine and sine modes) or ``complex`` (exp(i l phi), complex values).
        truncation: ``total`` keeps 2 p + |l| <= order; ``row`` keeps p + |l| <= order.
        form: ``der`` or ``std`` (orthonormal).

    Raises:
        InputError: an argument is out of range.
    """

    order: int
    kind: Kind = "real"
    truncation: Truncation = "total"
    form: Form = "der"
    dim: int = field(default=2, init=False, repr=False)
    name: ClassVar[str] = "laguerre"

    def __post_init__(self) -> None:
        """Check the settings."""
        check_settings(self, "Laguerre", 2)
        if self.kind not in get_args(Kind):
            raise InputError(f"Laguerre: kind is {self.kind!r}, wanted 'real' or 'complex'")

    @property
    def reach(self) -> int:
        """The lowest total order up to which Hermite modes hold all of it."""
        return self.order * (2 if self.truncation == "row" else 1)

    def indices(self) -> NDArray[np.intp]:
        """(n_coeff, 3) of p, l and 0 (cosine) or 1 (sine); complex (n_coeff, 2) of p and l."""
        if self.truncation == "total":
            return indices.laguerre_graded(self.order, self.kind)
        return indices.laguerre_rows(self.order, self.kind)

    def to_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """Own coefficients (..., n_coeff) to graded Hermite ones up to reach."""
        graded = np.zeros((*coeff.shape[:-1], indices.n_coeff(self.reach, 2)), coeff.dtype)
        graded[..., indices.laguerre_place(self.indices())] = coeff
        parts = indices.order_slices(self.reach, 2)
        matrices = laguerre_matrices(self.reach, self.kind)
        mixed = [graded[..., part] @ T for part, T in zip(parts, matrices, strict=True)]
        return np.concatenate(mixed, -1)

    def from_hermite(self, coeff: NDArray[Any]) -> NDArray[Any]:
        """The adjoint of ``to_hermite``."""
        parts = indices.order_slices(self.reach, 2)
        matrices = laguerre_matrices(self.reach, self.kind)
        mixed = [coeff[..., part] @ T.conj().T for part, T in zip(parts, matrices, strict=True)]
        return np.concatenate(mixed, -1)[..., indices.laguerre_place(self.indices())]

    def fourier(self, coeff: ArrayLike, k: ArrayLike) -> NDArray[Any]:
        """Integral of f(x) exp(-i k.x) dx; arguments and errors of ``Hermite.fourier``."""
        return self._hermite().fourier(self.to_hermite(self._read(coeff)), k)

    def rotate(self, coeff: ArrayLike, theta: ArrayLike) -> NDArray[Any]:
        """Coefficients of f(R^-1 x): exp(-i l theta) each, whatever the set.

        Args:
            coeff: (..., n_coeff).
            theta: angle in radians, counter-clockwise.

        Raises:
            InputError: coefficients do not fit, or theta is no angle.
        """
        rotation_matrix(theta, 2)
        return turned(self._read(coeff), self.indices(), float(np.asarray(theta)))

    def gram(self) -> NDArray[Any]:
        """Integrals of conj(mode) mode', (n_coeff, n_coeff); 1 in the standard form."""
        if self.form == "std":
            return np.eye(self.n_coeff)
        modes = self.to_hermite(np.eye(self.n_coeff))
        return np.asarray(modes.conj() @ self._hermite().gram() @ modes.T)

    def _hermite(self) -> Hermite:
        return Hermite(self.reach, 2, "total", self.form)

    def _modes(self, x: NDArray[Any]) -> NDArray[Any]:
        return functions(x, self.indices(), self.form, real=self.kind == "real")

    def _slopes(self, coeff: NDArray[Any], x: NDArray[Any]) -> NDArray[Any]:
        return self._hermite()._slopes(self.to_hermite(coeff), x)
