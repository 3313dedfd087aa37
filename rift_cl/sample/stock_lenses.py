"""Prescriptions of four lenses that come with the package; each file names where it is published.

They show what the steps from a lens to a pinhole lose: a lens of one element, a cemented pair, a
triplet and a double Gauss. ``rift_cl.io.open_lens`` reads them.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

STOCK_LENSES = ("singlet", "achromat", "cooke_triplet", "double_gauss")


def stock_lens(name: str) -> Path:
    """The file of one of ``STOCK_LENSES``.

    The package must lie on a disk as it does when pip installs it, not in a zip file.

    Raises:
        KeyError: there is no such lens.
    """
    if name not in STOCK_LENSES:
        raise KeyError(f"{name!r} is none of the stock lenses {', '.join(STOCK_LENSES)}")
    return Path(str(files("rift_cl.sample") / "lenses" / f"{name}.json"))
