"""Functions that splats are made of: Gaussians times polynomials, and colours by direction.

Over space (``Basis``): Gaussian, Hermite, Laguerre, SquaredHermite. Over directions
(``AngularBasis``): harmonics and lobes.
"""

from rift_cl.basis.angular import (
    ANGULAR_BASES,
    AngularBasis,
    AngularFunctions,
    AnisotropicSphericalGaussians,
    HGLobe,
    LGLobe,
    SphericalGaussians,
    SphericalHarmonics,
    angular_basis,
    register_angular_basis,
)
from rift_cl.basis.footprint import Footprint, footprint
from rift_cl.basis.gaussian import Gaussian
from rift_cl.basis.hermite import Hermite
from rift_cl.basis.indices import laguerre_place, n_coeff, order_of, place
from rift_cl.basis.laguerre import Laguerre
from rift_cl.basis.protocol import Basis, Evaluation
from rift_cl.basis.registry import BASES
from rift_cl.basis.squared_hermite import SquaredHermite

__all__ = [
    "ANGULAR_BASES",
    "BASES",
    "AngularBasis",
    "AngularFunctions",
    "AnisotropicSphericalGaussians",
    "Basis",
    "Evaluation",
    "Footprint",
    "Gaussian",
    "HGLobe",
    "Hermite",
    "LGLobe",
    "Laguerre",
    "SphericalGaussians",
    "SphericalHarmonics",
    "SquaredHermite",
    "angular_basis",
    "footprint",
    "laguerre_place",
    "n_coeff",
    "order_of",
    "place",
    "register_angular_basis",
]
