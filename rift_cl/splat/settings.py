"""Settings of the rasterizer, in one value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal, get_args

from rift_cl.basis.angular import ANGULAR_BASES
from rift_cl.errors import SettingError, checked_flag
from rift_cl.geometry.numbers import one_number
from rift_cl.option_marks import AutoExpert, Expert, NoOption, Short

SplatMode = Literal["light", "xray"]
Activation = Literal["clamp", "exp", "square"]
# Edges of tiles where none is given: large ones share what is read of a splat among more pixels,
# but a small image cut into few of them keeps few cores busy.
LARGE_TILE, SMALL_TILE, _ENOUGH = 32, 16, 64
# The near plane where nothing is known of the scene, in its units, and as a share of its size.
_NEAR, _NEAR_SHARE = 0.01, 0.002
# Devices count in float32.
_LARGEST = 3.4028234e38


@dataclass(frozen=True)
class SplatSettings:
    """Settings of the rasterizer; those of gsplat have its names' meaning and its defaults.

    Raises:
        InputError: a number is out of its range, or a choice is unknown.
    """

    near: AutoExpert[float] = None
    """Depth below which splats are left out, in scene units; above 0 for a pinhole. Default: of a
    fit, 1/500 of the size of the scene; otherwise 0.01."""
    far: Expert[float] = 1e10
    """Depth above which splats are left out, in scene units."""
    radius_clip: Expert[float] = 0.0
    """Radius up to which splats are left out, in pixels."""
    eps2d: Short[float] = 0.3
    """Variance added to every splat on the screen, in square pixels. 0.3 blurs small images; 0.05
    to 0.1 suits cameras at one distance."""
    tile: AutoExpert[int] = None
    """Edge of a tile in pixels: 8, 16 or 32. Default: 32 on a CPU where an image has 64 such
    tiles or more, otherwise 16."""
    alpha_cap: Expert[float] = 0.99
    """Largest alpha of one splat, above 0 and below 1."""
    antialiased: bool = False
    """Dim splats as eps2d widens them (Mip-Splatting)."""
    mode: NoOption[SplatMode] = "light"
    """``light`` composites front to back; ``xray`` adds line integrals, with opacities as densities
    whose mass ``eps2d`` does not change; those of 0 and below are not drawn."""
    absgrad: NoOption[bool] = False
    """Sum magnitudes of screen-position gradients as well, for densification."""
    smooth_cutoff: NoOption[bool] = False
    """Replace thresholds by smooth ones, so that finite differences hold; for tests alone."""
    activation: NoOption[Activation] = "clamp"
    """How a splat's density E = weight * Q * Gaussian, Q the polynomial of its modes, becomes an
    alpha in light mode: ``clamp`` max(E, 0), ``exp`` 1 - exp(-max(E, 0)), ``square``
    1 - exp(-weight Q^2 Gaussian). With the last two opacities are optical depths at the peak, any
    number >= 0."""
    angular: NoOption[str] = "sh"
    """Functions of the viewing direction that colours are made of: spherical harmonics, or ``hg``,
    ``lg`` (Hermite- and Laguerre-Gaussian lobes), ``sg``, ``asg`` (isotropic and anisotropic
    spherical Gaussians), which want ``Splats.lobes``."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        _check_flags(self)
        if not one_number(self.near_plane) < one_number(self.far):
            raise SettingError(
                self,
                "near",
                f"is {self.near_plane!r} and far is {self.far!r}, wanted near < far, both finite",
            )
        for name in ("radius_clip", "eps2d"):
            value = getattr(self, name)
            if not one_number(value) >= 0:
                raise SettingError(self, name, f"is {value!r}, wanted a number >= 0")
        for name in ("near_plane", "far", "radius_clip", "eps2d"):
            if abs(one_number(getattr(self, name))) > _LARGEST:
                raise SettingError(
                    self,
                    name.removesuffix("_plane"),
                    f"is {getattr(self, name)!r}, too large for float32",
                )
        edge = one_number(SMALL_TILE if self.tile is None else self.tile)
        if not (edge >= 1 and edge.is_integer()):
            raise SettingError(self, "tile", f"is {self.tile!r}, wanted a whole number >= 1")
        if not 0 < one_number(self.alpha_cap) < 1:
            raise SettingError(self, "alpha_cap", f"is {self.alpha_cap!r}, wanted 0 < cap < 1")
        for name, choices in (
            ("mode", get_args(SplatMode)),
            ("activation", get_args(Activation)),
        ):
            if getattr(self, name) not in choices:
                wanted = " or ".join(choices)
                raise SettingError(self, name, f"is {getattr(self, name)!r}, wanted {wanted}")
        if self.angular not in ANGULAR_BASES:
            said = f"is {self.angular!r}, wanted {ANGULAR_BASES.wanted}"
            raise SettingError(self, "angular", said)
        if self.antialiased and self.mode == "xray":
            raise SettingError(
                self,
                "antialiased",
                "has no meaning in xray mode, where dilation keeps a splat's mass: leave it off",
            )
        if self.activation != "clamp" and self.mode == "xray":
            raise SettingError(
                self,
                "activation",
                f"{self.activation} has no meaning in xray mode, which adds densities as they are: "
                "leave it at clamp",
            )

    @property
    def near_plane(self) -> float:
        """The depth below which splats are left out."""
        return _NEAR if self.near is None else self.near

    def for_scene(self, size: float) -> SplatSettings:
        """These settings with ``near`` chosen, for a scene of a size in its own units."""
        return self if self.near is not None else replace(self, near=_NEAR_SHARE * size)

    def for_image(self, size: tuple[int, int], *, cpu: bool) -> SplatSettings:
        """These settings with the tile's edge chosen, for an image on a kind of device.

        Args:
            size: (height, width) in pixels.
            cpu: whether a CPU draws it.
        """
        if self.tile is not None:
            return self
        tiles = -(-size[0] // LARGE_TILE) * -(-size[1] // LARGE_TILE)
        return _with_tile(self, LARGE_TILE if cpu and tiles >= _ENOUGH else SMALL_TILE)

    @property
    def edge(self) -> int:
        """Edge of a tile in pixels, which ``for_image`` has chosen."""
        assert self.tile is not None
        return self.tile


@cache
def _with_tile(settings: SplatSettings, edge: int) -> SplatSettings:
    return replace(settings, tile=edge)


def _check_flags(settings: SplatSettings) -> None:
    for name in ("antialiased", "absgrad", "smooth_cutoff"):
        checked_flag("SplatSettings", name, getattr(settings, name))
