"""The options of ``rift fit`` about splats that are more than Gaussians."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.errors import InputError
from rift_cl.splat.settings import Activation, Angular
from rift_cl.train.basis_settings import AngularSettings, BasisKind, BasisSettings

# Order of Hermite splats where none is given.
_USUAL_ORDER = 1


@dataclass(frozen=True, kw_only=True)
class BasisOptions:
    """Which modes and lobes the splats have; none by default."""

    basis: BasisKind = "gaussian"
    """Splats of X-rays or photographs: plain (gaussian), or with Hermite- or Laguerre-Gaussian
    modes up to --order, which span the same and are stored alike."""
    order: int | None = None
    """Highest order of the modes, 0 to 8, with --basis hermite or laguerre; 1 if not given. The
    colours' modes have it as well, unless --color-order says otherwise."""
    color_order: int | None = None
    """Photographs: highest order of the modes of each splat's colour, 0 to 8."""
    activation: Activation = "clamp"
    """Photographs: how a splat's density E becomes its alpha: max(E, 0), 1 - exp(-max(E, 0)), or
    1 - exp(-E) with the polynomial squared, so that E is never negative."""
    angular: Angular = "sh"
    """Photographs: what colours vary in with the direction: spherical harmonics, Hermite- or
    Laguerre-Gaussian lobes with an axis and a width (hg, lg), or isotropic or anisotropic spherical
    Gaussians (sg, asg)."""
    modes: int | None = None
    """Photographs: modes, or spherical Gaussians, besides the constant, 1 to 35; 8 if not given."""

    def check_basis(self) -> None:
        """Check what belongs together.

        Raises:
            InputError: an option has no meaning beside the others.
        """
        if self.basis == "gaussian":
            for name in ("order", "color_order"):
                if getattr(self, name) is not None:
                    option = name.replace("_", "-")
                    raise InputError(
                        f"--{option} is {getattr(self, name)}, but Gaussian splats have no modes: "
                        "add --basis hermite, or leave it out"
                    )
        if self.modes is not None and self.angular == "sh":
            raise InputError(
                "--modes counts lobes: add --angular hg, lg, sg or asg, or say --sh-degree for "
                "harmonics"
            )

    def basis_settings(self, *, colored: bool = True) -> BasisSettings:
        """The modes that the trainer gives to splats, of which X-rays have no coloured ones."""
        if self.basis == "gaussian":
            return BasisSettings(activation=self.activation)
        order = _USUAL_ORDER if self.order is None else self.order
        color = order if self.color_order is None else self.color_order
        return BasisSettings(self.basis, order, color if colored else 0, self.activation)

    def angular_settings(self) -> AngularSettings:
        """What colours vary in."""
        if self.modes is None:
            return AngularSettings(self.angular)
        return AngularSettings(self.angular, self.modes)

    def basis_words(self, *, colored: bool = True) -> str:
        """What splats are, in words; empty for Gaussians in harmonics."""
        basis, angular = self.basis_settings(colored=colored), self.angular_settings()
        orders = {"shape": basis.order, "colour": basis.color_order}
        words = [f"{name} order {order}" for name, order in orders.items() if order]
        if words:
            words[0] = f"{basis.kind} splats of {words[0]}"
        words += [] if basis.activation == "clamp" else [f"activation {basis.activation}"]
        words += [] if angular.kind == "sh" else [f"{angular.modes} {angular.kind} functions"]
        return ", ".join(words)

    def basis_facts(self, *, colored: bool = True) -> dict[str, str]:
        """What a fit's figures say of it; nothing for Gaussians in harmonics."""
        words = self.basis_words(colored=colored)
        return {"basis": words} if words else {}
