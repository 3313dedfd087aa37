"""Spatial bases by name, for settings and files."""

from __future__ import annotations

from collections.abc import Callable

from rift_cl.basis.gaussian import Gaussian
from rift_cl.basis.hermite import Hermite
from rift_cl.basis.laguerre import Laguerre
from rift_cl.basis.protocol import Basis
from rift_cl.basis.squared_hermite import SquaredHermite
from rift_cl.registry import Registry

BASES: Registry[Callable[..., Basis]] = Registry(
    "basis", {kind.name: kind for kind in (Gaussian, Hermite, Laguerre, SquaredHermite)}
)
