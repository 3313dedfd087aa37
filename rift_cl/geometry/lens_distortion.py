"""What a real lens does to the picture of a pinhole, in the models of OpenCV and COLMAP.

Splats are drawn by a pinhole, photographs are taken through a lens. A ``Lens`` says where the
photograph shows what a pinhole with the same focal lengths and principal point would see at a
given pixel, which is all that is needed to take the distortion out of a photograph.

Formulas: OpenCV's documentation (``calib3d`` and ``fisheye``) for the radial, tangential and
equidistant parts, Weng et al. 1992 for the thin prism, Devernay and Faugeras 2001 for ``FOV``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.numbers import real_numbers

Points = NDArray[np.float64]

LENS_MODELS = {
    "SIMPLE_RADIAL": ("k1",),
    "RADIAL": ("k1", "k2"),
    "OPENCV": ("k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "FOV": ("omega",),
    "SIMPLE_RADIAL_FISHEYE": ("k1",),
    "RADIAL_FISHEYE": ("k1", "k2"),
    "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
    "THIN_PRISM_FISHEYE": ("k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "SIMPLE_FISHEYE": (),
    "FISHEYE": (),
}
_PINHOLES = ("SIMPLE_PINHOLE", "PINHOLE")
# Far beyond any lens, and small enough that products of coefficients stay finite.
_LARGEST = 1e12


@dataclass(frozen=True, eq=False)
class Lens:
    """A lens that distorts; equal lenses hash equally.

    Args:
        model: one of ``LENS_MODELS``, by the names of COLMAP.
        coefficients: the numbers of the model, in the order of ``LENS_MODELS``.
        K: (3, 3) intrinsics of the photograph in pixels, without skew; kept read-only, float64.

    Raises:
        InputError: the model is unknown, a coefficient is no number that it can take, or ``K``
            is no matrix of intrinsics.
        ShapeError: the model takes another number of coefficients.
        NonFiniteError: a coefficient or an entry of ``K`` is not finite.
    """

    model: str
    coefficients: tuple[float, ...]
    K: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        object.__setattr__(self, "coefficients", _coefficients(self.model, self.coefficients))
        object.__setattr__(self, "K", _intrinsics(self.K))

    def __eq__(self, other: object) -> bool:
        """Lenses are equal when they distort every point alike."""
        return isinstance(other, Lens) and self._key() == other._key()

    def __hash__(self) -> int:
        """Equal lenses hash equally."""
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies are made by the constructor, so that their matrix is read-only as well."""
        return Lens, (self.model, self.coefficients, self.K)

    def _key(self) -> tuple[str, tuple[float, ...], bytes]:
        return self.model, self.coefficients, self.K.tobytes()

    def distort(self, points: ArrayLike) -> Points:
        """Where the photograph shows what a pinhole with the same ``K`` sees at a point.

        Args:
            points: (..., 2) pixel coordinates x, y in the image of the pinhole; pixel (i, j)
                has its centre at (j + 0.5, i + 0.5).

        Returns:
            (..., 2) pixel coordinates in the photograph. NaN where the model does not reach:
            a polynomial that was fitted to the image turns back somewhere outside it, and would
            show the same part of the photograph a second time.

        Raises:
            ShapeError: the points are not (..., 2) real numbers.
        """
        values = real_numbers(points)
        if values is None or values.ndim == 0 or values.shape[-1] != 2:
            raise ShapeError("Lens.distort: points are wanted as (..., 2) real numbers")
        focal, center = self.K[[0, 1], [0, 1]], self.K[:2, 2]
        with np.errstate(all="ignore"):
            moved: Points = self._distort((values - center) / focal) * focal + center
        return moved

    def _distort(self, xy: Points) -> Points:
        """Distort points of the plane at depth one."""
        terms = dict(zip(LENS_MODELS[self.model], self.coefficients, strict=True))
        if self.model == "FOV":
            return xy * _field_of_view(np.hypot(xy[..., 0], xy[..., 1]), terms["omega"])[..., None]
        if self.model.endswith("FISHEYE"):
            radius = np.hypot(xy[..., 0], xy[..., 1])
            angle = np.arctan(radius)
            xy = (
                xy * np.divide(angle, radius, out=np.ones_like(radius), where=radius > 0)[..., None]
            )
        above, below = _radial(self.model, terms)
        x, y = xy[..., 0], xy[..., 1]
        square = x * x + y * y
        factor = np.polynomial.Polynomial(above)(square) / np.polynomial.Polynomial(below)(square)
        p1, p2 = terms.get("p1", 0.0), terms.get("p2", 0.0)
        sx, sy = terms.get("sx1", 0.0), terms.get("sy1", 0.0)
        moved: Points = np.empty_like(xy)
        moved[..., 0] = x * factor + 2 * p1 * x * y + p2 * (square + 2 * x * x) + sx * square
        moved[..., 1] = y * factor + 2 * p2 * x * y + p1 * (square + 2 * y * y) + sy * square
        moved[~(square < _turning_square(above, below))] = np.nan
        return moved


def lens_of(model: str, coefficients: Sequence[float], K: ArrayLike) -> Lens | None:
    """The lens of a camera model, or None where the photograph is what a pinhole sees.

    Raises:
        InputError: the model is unknown; the error lists those that are known. Other errors
            are those of ``Lens``.
    """
    if model in _PINHOLES:
        if len(coefficients):
            raise ShapeError(f"Lens: {model} takes no coefficients, not {coefficients!r}")
        return None
    lens = Lens(model, tuple(coefficients), _intrinsics(K))
    # Without coefficients a fisheye is still one.
    return lens if any(lens.coefficients) or model.endswith("FISHEYE") else None


def _radial(model: str, terms: dict[str, float]) -> tuple[list[float], list[float]]:
    """The radial factor as polynomials in the squared radius: above and below the line."""
    k1, k2, k3, k4, k5, k6 = (terms.get(f"k{i}", 0.0) for i in range(1, 7))
    if model == "FULL_OPENCV":
        return [1, k1, k2, k3], [1, k4, k5, k6]
    return [1, k1, k2, k3, k4], [1]


def _turning_square(above: list[float], below: list[float]) -> float:
    """The squared radius up to which the distorted radius grows, from the radial part alone."""
    n, d = np.polynomial.Polynomial(above), np.polynomial.Polynomial(below)
    u = np.polynomial.Polynomial([0, 1])
    slope = (n + 2 * u * n.deriv()) * d - 2 * u * n * d.deriv()
    # Both polynomials are 1 at the centre. As polynomials in 1/u they start with that 1, so that
    # their roots can be found whatever the coefficients are.
    inverse = [np.roots(polynomial.coef) for polynomial in (slope, d)]
    found = [float(r.real) for roots in inverse for r in roots if r.imag == 0 and r.real > 0]
    return 1 / max(found) if found else math.inf


def _field_of_view(radius: Points, omega: float) -> Points:
    slope = 2 * math.tan(omega / 2)
    if slope == 0:
        return np.ones_like(radius)
    nearly = np.full_like(radius, slope / omega)
    factor: Points = np.divide(
        np.arctan(slope * radius), omega * radius, out=nearly, where=radius > 0
    )
    return factor


def _coefficients(model: str, values: Sequence[float]) -> tuple[float, ...]:
    if model not in LENS_MODELS:
        known = ", ".join((*_PINHOLES, *LENS_MODELS))
        raise InputError(f"Lens: camera model {model!r} is not known; known are {known}")
    names = LENS_MODELS[model]
    numbers = real_numbers(values)
    if numbers is None or numbers.shape != (len(names),):
        raise ShapeError(
            f"Lens: {model} takes {len(names)} coefficients ({', '.join(names)}), not {values!r}"
        )
    for name, number in zip(names, numbers.tolist(), strict=True):
        if not math.isfinite(number):
            raise NonFiniteError(f"Lens: {name} of {model} is {number}, wanted a finite number")
        if abs(number) > (_LARGEST if name != "omega" else 0.999 * math.pi):
            raise InputError(f"Lens: {name} of {model} is {number:g}, no lens is like that")
    return tuple(numbers.tolist())


def _intrinsics(values: ArrayLike) -> NDArray[np.float64]:
    K = real_numbers(values)
    if K is None or K.shape != (3, 3):
        raise ShapeError("Lens: K is wanted as a (3, 3) matrix of real numbers")
    if not np.isfinite(K).all():
        raise NonFiniteError(f"Lens: K is {K.tolist()}, every entry must be finite")
    wanted = [[K[0, 0], 0, K[0, 2]], [0, K[1, 1], K[1, 2]], [0, 0, 1]]
    if min(K[0, 0], K[1, 1]) <= 0 or not np.array_equal(K, wanted):
        raise InputError(f"Lens: K is {K.tolist()}, wanted positive focal lengths and no skew")
    K.flags.writeable = False
    return K
