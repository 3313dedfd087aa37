"""Phase retrieval from one propagation distance, for an object of one material.

Behind the object the beam goes on for a distance in which phase shifts become intensity: edges are
enhanced. For a homogeneous object of refractive index 1 - delta + i beta both attenuation and phase
follow from its thickness T, which one image is enough to recover: Paganin, Mayo, Gureyev, Miller
and Wilkins, "Simultaneous phase and amplitude extraction from a single defocused image of a
homogeneous object", J. Microsc. 206, 33 (2002):

    T = -(1 / mu) ln F^-1[ F[I / I0] / (1 + (z delta / mu) |k|^2) ],    mu = 4 pi beta / wavelength

for a parallel beam. As only z delta / mu enters the filter, the ratio delta / beta and the energy
are enough for the line integral mu T, from which filtered backprojection makes mu.

The image is continued by its mirror image without end, which is what a cosine transform does; so
nothing is padded and nothing meets itself across the border.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError, checked_flag
from rift_cl.reconstruct.preprocess.projection_array import as_projections

Floats = NDArray[np.float32]

# Planck's constant times the speed of light, in keV metres (CODATA 2018, exact).
_HC = 1.239841984332e-9
# Less of the beam than this is not told from none, as in the flat-field correction.
_FAINTEST = 1e-7
# Bytes of projections that are transformed together.
_BLOCK = 64 << 20
# A mean above this is that of counts: propagation brightens edges, and not whole projections.
_BRIGHTEST = 2.0
# Photons of more, in keV, are no imaging beam's. A filter that decays over less than this share of
# a pixel keeps more than half of the finest detail: no fringes are seen that it could retrieve.
_HARDEST, _NARROWEST = 500.0, 0.25
# The filter's decay is followed this many of its lengths, in which it falls by 1e-17.
_LENGTHS = 40
_MOST_ROWS = 1 << 22


@dataclass(frozen=True)
class Propagation:
    """How projections were taken, as far as phase retrieval has to know.

    Args:
        pixel: edge of a detector pixel at the object, in metres; or distance between rows and
            between bins.
        distance: from the object to the detector, in metres.
        energy: of the photons, in keV.
        delta_beta: delta / beta of the material at this energy.
        generalised: put a finite difference in place of |k|^2, which suppresses high frequencies
            less: Paganin, Favre-Nicolin, Mirone et al., "Boosting spatial resolution by
            incorporating periodic boundary conditions into single-distance hard-x-ray phase
            retrieval", J. Opt. 22, 115607 (2020).

    Raises:
        InputError: one of the numbers is missing or not positive.
    """

    pixel: float | tuple[float, float]
    distance: float
    energy: float
    delta_beta: float
    generalised: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        checked_flag("phase retrieval", "generalised", self.generalised)
        units = {"pixel": "metres", "distance": "metres", "energy": "keV", "delta_beta": "no unit"}
        for name, unit in units.items():
            value = getattr(self, name)
            if not all(map(_is_positive, self.edges if name == "pixel" else (value,))):
                raise InputError(
                    f"phase retrieval: {name} is {value}, wanted a positive number ({unit}); it "
                    "needs pixel, distance, energy and delta_beta"
                )

    @property
    def edges(self) -> tuple[float, float]:
        """Distance between rows and between bins at the object, in metres."""
        return self.pixel if isinstance(self.pixel, tuple) else (self.pixel, self.pixel)

    @property
    def wavelength(self) -> float:
        """Of the photons, in metres."""
        return _HC / self.energy

    @property
    def decay_length(self) -> float:
        """The distance over which the filter blurs, sqrt(z delta / mu), in metres."""
        return math.sqrt(self.distance * self.delta_beta * self.wavelength / (4 * math.pi))

    def doubt(self, bins: int) -> str:
        """What cannot be true of these numbers, as of one in another unit; empty where nothing.

        Args:
            bins: of a detector row.
        """
        wide = self.decay_length / self.edges[1]
        if self.energy > _HARDEST:
            found = f"photons of {self.energy:g} keV are no imaging beam's"
        elif wide < _NARROWEST:
            found = f"a filter of {wide:.2g} pixels changes next to nothing"
        elif wide > bins:
            found = f"a filter of {wide:.3g} pixels is wider than the detector's {bins} bins"
        else:
            return ""
        return (
            f"{found}: are {self.energy:g} keV, a distance of {self.distance:.4g} m and pixels of "
            f"{1e6 * self.edges[1]:.4g} um what is meant (--energy, --propagation, --pitch)?"
        )

    def response(self, rows: int, bins: int) -> NDArray[np.float64]:
        """What the filter multiplies the cosine transform of (rows, bins) pixels by."""
        sizes = zip((rows, bins), self.edges, strict=True)
        down, along = (self._laplacian(count, edge) for count, edge in sizes)
        return np.asarray(1 / (1 + self.decay_length**2 * (down[:, None] + along)))

    def halo_rows(self, error: float = 1e-5) -> int:
        """Rows that a slab needs on either side to be filtered as if it were the whole projection.

        Args:
            error: most that the filtered transmission may differ, as a share of the beam; a line
                integral p differs by exp(p) times as much.

        Raises:
            InputError: the error is not between 0 and 1, or the filter reaches over millions of
                rows, which means that a unit is wrong.
        """
        if not 0 < error < 1:
            raise InputError(f"error is {error}, wanted a share of the beam between 0 and 1")
        row_edge = self.edges[0]
        length = self.decay_length / row_edge
        reach = 64 + math.ceil(_LENGTHS * length)
        if reach > _MOST_ROWS:
            raise InputError(
                f"phase retrieval: the filter reaches over {length:.3g} rows: are pixel "
                f"({row_edge:g}) and distance ({self.distance:g}) in metres, energy "
                f"({self.energy:g}) in keV?"
            )
        # What rows beyond the halo contribute if they differ by the whole beam.
        response = 1 / (1 + self.decay_length**2 * self._laplacian(reach, row_edge))
        kernel = np.abs(np.fft.irfft(np.append(response, response[-1]), 2 * reach))[:reach]
        beyond = np.cumsum(kernel[::-1])[::-1]
        return int(np.flatnonzero(beyond < error)[0]) if beyond[-1] < error else reach

    def _laplacian(self, count: int, edge: float) -> NDArray[np.float64]:
        """|k|^2 along one axis of samples so far apart, at the cosine transform's frequencies."""
        phase = np.pi * np.arange(count) / count
        squared = 2 - 2 * np.cos(phase) if self.generalised else phase**2
        return np.asarray(squared / edge**2)


def paganin(
    transmission: Any,
    *,
    pixel: float | tuple[float, float],
    distance: float,
    energy: float,
    delta_beta: float,
    beta: float | None = None,
    generalised: bool = False,
) -> Floats:
    """Line integrals of attenuation from propagated projections, or the object's thickness.

    Args:
        transmission: I / I0 behind the object, flat and dark corrected and before any logarithm,
            (angle, row, bin); whole projections, or slabs with ``halo_rows`` more on either side.
        pixel: as for ``Propagation``.
        distance: from the object to the detector, in metres.
        energy: of the photons, in keV.
        delta_beta: delta / beta of the material at this energy.
        beta: of the material at this energy; if given, the result is its thickness in metres.
        generalised: see ``Propagation``.

    Returns:
        mu T (no unit), or T in metres where ``beta`` is given; float32 of the same shape. Less than
        1e-7 of the beam counts as 1e-7, as in ``attenuation``.

    Raises:
        ShapeError: the array has other axes, or a single row.
        NonFiniteError: a value is NaN or infinite.
        InputError: a physical number is missing or not positive, or the values are no
            transmissions.
    """
    setting = Propagation(pixel, distance, energy, delta_beta, generalised)
    if beta is not None and not _is_positive(beta):
        raise InputError(f"phase retrieval: beta is {beta}, wanted a positive number")
    stack = as_projections(transmission, name="transmission", one_row=False)
    _check_transmission(stack)
    mu = 1.0 if beta is None else 4 * math.pi * beta / setting.wavelength
    views, rows, bins = stack.shape
    response = setting.response(rows, bins).astype(np.float32)
    out = np.empty(stack.shape, np.float32)
    block = max(1, _BLOCK // (4 * rows * bins))
    for first in range(0, views, block):
        views_of = slice(first, first + block)
        out[views_of] = _line_integrals(stack[views_of], response)
    out /= mu
    return out


def halo_rows(
    *,
    pixel: float | tuple[float, float],
    distance: float,
    energy: float,
    delta_beta: float,
    generalised: bool = False,
    error: float = 1e-5,
) -> int:
    """Rows that a slab needs on either side; see ``Propagation.halo_rows``."""
    return Propagation(pixel, distance, energy, delta_beta, generalised).halo_rows(error)


def _line_integrals(stack: Floats, response: Floats) -> Floats:
    from scipy.fft import dctn, idctn

    spectrum = dctn(stack, axes=(1, 2), workers=-1)
    spectrum *= response
    filtered = idctn(spectrum, axes=(1, 2), overwrite_x=True, workers=-1)
    np.maximum(filtered, _FAINTEST, out=filtered)
    integrals: Floats = np.negative(np.log(filtered, out=filtered), out=filtered)
    return integrals


def _check_transmission(stack: Floats) -> None:
    if not stack.size:
        raise ShapeError(f"transmission has shape {stack.shape}: it holds nothing")
    if stack.shape[1] == 1:
        raise ShapeError(
            "transmission has a single row: phase retrieval needs the rows above and below; of an "
            "object that is the same along the rotation axis, repeat the row"
        )
    mean = float(stack.mean(dtype=np.float64))
    if mean > _BRIGHTEST:
        raise InputError(
            f"transmission has the mean {mean:g}, wanted I / I0 between 0 and 1: correct by flat "
            "and dark frames before"
        )


def _is_positive(value: Any) -> bool:
    try:
        return 0 < float(value) < math.inf
    except (TypeError, ValueError):
        return False
