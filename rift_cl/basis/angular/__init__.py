"""Functions of the viewing direction, behind one interface: what a splat's colour is made of.

Five kinds, by the name that settings, files and commands know them by; ``protocol`` says what
they have in common.
"""

from __future__ import annotations

from collections.abc import Callable

from rift_cl.basis.angular.chart import HGLobe, LGLobe
from rift_cl.basis.angular.gaussians import AnisotropicSphericalGaussians, SphericalGaussians
from rift_cl.basis.angular.harmonics import SphericalHarmonics
from rift_cl.basis.angular.protocol import AngularBasis, AngularGradients, Slopes
from rift_cl.errors import InputError

__all__ = [
    "ANGULAR_KINDS",
    "AngularBasis",
    "AngularGradients",
    "AnisotropicSphericalGaussians",
    "HGLobe",
    "LGLobe",
    "Slopes",
    "SphericalGaussians",
    "SphericalHarmonics",
    "angular_basis",
]

_WITH: dict[str, Callable[[int], AngularBasis]] = {
    "sh": SphericalHarmonics.of_count,
    "hg": HGLobe,
    "lg": LGLobe,
    "sg": SphericalGaussians.of_count,
    "asg": AnisotropicSphericalGaussians.of_count,
}
ANGULAR_KINDS = tuple(_WITH)


def angular_basis(kind: str, n_linear: int) -> AngularBasis:
    """The basis of a kind that has this many functions.

    Args:
        kind: ``sh``, ``hg``, ``lg``, ``sg`` or ``asg``.
        n_linear: all functions, the constant included: 1, 4, 9, 16 or 25 harmonics; 1 to 36 of a
            chart lobe; 2 to 36 of spherical Gaussians, which is one more than there are lobes.

    Raises:
        InputError: the kind is unknown, or has no such number of functions.
    """
    if kind not in _WITH:
        raise InputError(
            f"angular_basis: kind is {kind!r}, wanted one of {', '.join(ANGULAR_KINDS)}"
        )
    return _WITH[kind](n_linear)
