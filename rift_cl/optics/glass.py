"""The index of refraction of a glass at a wavelength, by the formula that its maker gives.

Prescriptions name glasses; rays want numbers. Wavelengths are in millimetres, as all lengths of a
lens are: 550 nm is 550e-6.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

from rift_cl.errors import InputError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.optics.glass_catalogue import POWERS, SAME, SELLMEIER

Formula = Literal["sellmeier", "powers", "model", "constant"]

# Fraunhofer's lines d, F and C, in micrometres.
LINE_D, LINE_F, LINE_C = 0.5875618, 0.4861327, 0.6562725
_COUNTS = {"sellmeier": 6, "powers": 6, "model": 2, "constant": 1}
# Nothing that is transparent lies outside, germanium included; micrometres for the wavelength.
_INDICES, _WAVELENGTHS = (1.0, 5.0), (0.1, 20.0)


@dataclass(frozen=True)
class Glass:
    """A transparent medium.

    Args:
        name: as prescriptions have it.
        formula: ``sellmeier`` (B1, B2, B3, C1, C2, C3 for micrometres: n^2 = 1 + sum of
            B w^2 / (w^2 - C)); ``powers`` (n^2 = a0 + a1 w^2 + a2 w^-2 + a3 w^-4 + ...);
            ``model`` (index at line d and Abbe number, n = a + b / w^2 through both);
            ``constant`` (one index for all light).
        numbers: of the formula.

    Raises:
        InputError: the formula is unknown, or its numbers are no numbers it can take.
    """

    name: str
    formula: Formula
    numbers: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.formula not in get_args(Formula):
            wanted = ", ".join(get_args(Formula))
            raise InputError(f"Glass {self.name!r}: formula is {self.formula!r}, wanted {wanted}")
        numbers = real_numbers(self.numbers)
        count = _COUNTS[self.formula]
        if numbers is None or numbers.shape != (count,) or not all(map(math.isfinite, numbers)):
            raise InputError(
                f"Glass {self.name!r}: numbers are {self.numbers!r}, the formula "
                f"{self.formula!r} wants {count} finite ones"
            )
        object.__setattr__(self, "numbers", tuple(numbers.tolist()))
        if self.formula == "model" and not self.numbers[1] > 0:
            raise InputError(
                f"Glass {self.name!r}: the Abbe number is {self.numbers[1]:g}, wanted a positive "
                "one; a medium without dispersion is given by its index alone"
            )
        self.index(LINE_D * 1e-3)

    def index(self, wavelength: float) -> float:
        """Index of refraction relative to air.

        Args:
            wavelength: in millimetres.

        Raises:
            InputError: the formula gives none there.
        """
        w = one_number(wavelength) * 1e3
        if not _WAVELENGTHS[0] <= w <= _WAVELENGTHS[1]:
            raise InputError(
                f"Glass {self.name!r}: wavelength is {wavelength!r} mm, wanted one from "
                f"{_WAVELENGTHS[0] * 1e-3:g} to {_WAVELENGTHS[1] * 1e-3:g} mm"
            )
        found = self._index(w)
        if not _INDICES[0] <= found <= _INDICES[1]:
            raise InputError(
                f"Glass {self.name!r}: its formula gives the index {found:g} at {w:g} micrometres, "
                "no glass is like that"
            )
        return found

    def _index(self, w: float) -> float:
        n = self.numbers
        if self.formula == "constant":
            return n[0]
        if self.formula == "model":
            slope = (n[0] - 1) / n[1] / (LINE_F**-2 - LINE_C**-2)
            return n[0] + slope * (w**-2 - LINE_D**-2)
        if self.formula == "powers":
            square = n[0] + n[1] * w**2 + sum(a * w ** (-2 * i - 2) for i, a in enumerate(n[2:]))
        else:
            terms = zip(n[:3], n[3:], strict=True)
            square = 1 + sum(B * w**2 / (w**2 - C) if w**2 != C else math.inf for B, C in terms)
        return math.sqrt(square) if square > 0 else math.nan


def glass(name: str) -> Glass:
    """A glass of the built-in catalogue, by its maker's name.

    Raises:
        InputError: it is not there; the error says how to give it by numbers.
    """
    catalogue = _catalogue()
    key = name.strip().upper()
    key = SAME.get(key, key)
    if key in catalogue:
        return catalogue[key]
    near = difflib.get_close_matches(key, [*catalogue, *SAME], 3, 0.6)
    hint = f"; near it are {', '.join(near)}" if near else ""
    raise InputError(
        f"glass {name!r} is not in the built-in catalogue of {len(catalogue)}{hint}; give it by "
        "its index at the line d and its Abbe number instead"
    )


@cache
def _catalogue() -> dict[str, Glass]:
    found: dict[str, Glass] = {}
    tables: tuple[tuple[Formula, str], ...] = (("sellmeier", SELLMEIER), ("powers", POWERS))
    for formula, table in tables:
        for line in table.strip().splitlines():
            name, *numbers = line.split()
            found[name] = Glass(name, formula, tuple(map(float, numbers)))
    return found
