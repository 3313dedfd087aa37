"""Functions of the viewing direction, behind one interface: what a splat's colour is made of.

Five kinds, by the name that settings, files and commands know them by, and those that a user
registers; ``protocol`` says what they have in common.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from rift_cl.basis.angular.chart import HGLobe, LGLobe
from rift_cl.basis.angular.frame import unit_axes, unit_directions
from rift_cl.basis.angular.gaussians import AnisotropicSphericalGaussians, SphericalGaussians
from rift_cl.basis.angular.harmonics import SphericalHarmonics
from rift_cl.basis.angular.own_basis import check_own_basis
from rift_cl.basis.angular.protocol import (
    CONSTANT,
    AngularBasis,
    AngularFunctions,
    AngularGradients,
    Slopes,
)
from rift_cl.errors import InputError
from rift_cl.registry import Registry

__all__ = [
    "ANGULAR_BASES",
    "CONSTANT",
    "AngularBasis",
    "AngularFunctions",
    "AngularGradients",
    "AnisotropicSphericalGaussians",
    "HGLobe",
    "LGLobe",
    "Slopes",
    "SphericalGaussians",
    "SphericalHarmonics",
    "angular_basis",
    "register_angular_basis",
    "unit_axes",
    "unit_directions",
]

ANGULAR_BASES: Registry[Callable[[int], AngularBasis]] = Registry(
    "angular basis",
    {
        "sh": SphericalHarmonics.of_count,
        "hg": HGLobe,
        "lg": LGLobe,
        "sg": SphericalGaussians.of_count,
        "asg": AnisotropicSphericalGaussians.of_count,
    },
)
_OURS = ANGULAR_BASES.names
# Bases of users that were tried, with so many functions.
_CHECKED: set[tuple[Callable[[int], AngularBasis], int]] = set()
# What the comment of a file of splats can hold.
_NAME = re.compile(r"[a-z0-9]+")


def register_angular_basis(
    name: str, basis: Callable[[int], AngularBasis], *, replace: bool = False
) -> None:
    """Make an angular basis known by a name, for ``AngularSettings`` and ``SplatSettings``.

    Its colours are computed on the host, in NumPy, which is slower than the kernels that the
    package's own bases have.

    Args:
        name: small letters and digits.
        basis: makes the basis of so many functions, the constant included; one derived from
            ``AngularFunctions``, with at least one number of geometry.
        replace: take the place of one that was registered by that name before.

    Raises:
        InputError: the name is taken or has other characters.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            f"register_angular_basis: the name is {name!r}, wanted small letters and digits"
        )
    ANGULAR_BASES.add(name, basis, replace=replace)


def angular_basis(kind: str, n_linear: int) -> AngularBasis:
    """The basis of a kind that has this many functions.

    Args:
        kind: ``sh``, ``hg``, ``lg``, ``sg``, ``asg``, or one that was registered.
        n_linear: all functions, the constant included: 1, 4, 9, 16 or 25 harmonics; 1 to 36 of a
            chart lobe; 2 to 36 of spherical Gaussians, which is one more than there are lobes.

    Raises:
        InputError: the kind is unknown, has no such number of functions, or was registered and
            does not do what ``AngularFunctions`` promises.
    """
    make = ANGULAR_BASES[kind]
    basis = make(n_linear)
    if kind not in _OURS and (make, n_linear) not in _CHECKED:
        check_own_basis(kind, basis, n_linear)
        _CHECKED.add((make, n_linear))
    return basis
