"""Phantoms made of ellipsoids: known objects whose line integrals are known exactly.

An ellipsoid of constant value has a closed-form projection and a closed-form spectrum, so a
phantom gives a picture and the measurements that a perfect scanner would make of it, by rays side
by side, in fans or in cones, none derived from another. The Shepp-Logan head is the standard one;
``render``, ``project`` and ``spectrum`` take any list of ellipsoids.

An image has no z: it shows the equatorial section of every ellipsoid, which is how the classic
two-dimensional head is contained in the three-dimensional one.
"""

from rift_cl.phantom.ellipsoid import Ellipsoid
from rift_cl.phantom.head import SHEPP_LOGAN, head, shepp_logan, shepp_logan_sinogram
from rift_cl.phantom.projection import project
from rift_cl.phantom.rendering import render
from rift_cl.phantom.spectrum import spectrum

__all__ = [
    "SHEPP_LOGAN",
    "Ellipsoid",
    "head",
    "project",
    "render",
    "shepp_logan",
    "shepp_logan_sinogram",
    "spectrum",
]
