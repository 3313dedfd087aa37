"""Spatial bases by name, for settings and files."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

from rift_cl.basis.gaussian import Gaussian
from rift_cl.basis.hermite import Hermite
from rift_cl.basis.laguerre import Laguerre
from rift_cl.basis.protocol import Basis
from rift_cl.basis.squared_hermite import SquaredHermite
from rift_cl.errors import InputError

BASES: MappingProxyType[str, Callable[..., Basis]] = MappingProxyType(
    {kind.name: kind for kind in (Gaussian, Hermite, Laguerre, SquaredHermite)}
)


def basis_named(name: str) -> Callable[..., Basis]:
    """The class of a basis.

    Raises:
        InputError: no basis has that name.
    """
    if name not in BASES:
        raise InputError(f"basis is {name!r}, wanted one of {', '.join(BASES)}")
    return BASES[name]
