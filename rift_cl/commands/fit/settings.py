"""The settings that ``rift fit photos`` and ``rift fit xray`` have in common."""

from __future__ import annotations

import dataclasses
import shlex
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from tyro.conf import Positional

from rift_cl.errors import InputError
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.basis_settings import BasisKind
from rift_cl.train.loss.homogenisation import WeightKind
from rift_cl.train.settings import BandLimit, TrainSettings

# Settings that may differ between a run and the one that resumes it: they change no bit of the
# result.
_FREE = (
    *("out", "resume", "overwrite", "dry_run", "checkpoint_every", "view", "device", "config"),
    *("memory", "format"),
)
# Order of Hermite splats where none is given.
USUAL_ORDER = 1


@dataclass(frozen=True)
class FitSettings(ABC):
    """What every fit is told."""

    # The command, as config.json names it.
    job: ClassVar[str]

    capture: Annotated[Path, Positional]
    """What is fitted."""
    out: Path = Path("rift-fit")
    """Folder for scene.ply, report.html, config.json, metrics.json and checkpoints."""
    steps: int = 3000
    """Number of optimization steps (one training image each)."""
    splats: int = 20_000
    """Maximum number of splats."""
    seed: int = 0
    """Random seed; the same seed gives the same splats, bit by bit."""
    basis: BasisKind = "gaussian"
    """Kind of splats: plain (gaussian), or with Hermite- or Laguerre-Gaussian modes up to --order,
    which span the same functions and are stored alike."""
    order: int | None = None
    """Highest order of the modes, 0 to 8, with --basis hermite or laguerre. Default: 1."""
    eps2d: float = 0.1
    """Variance added to every splat on the screen, in square pixels. 0.3 is usual elsewhere and
    blurs small images; 0.05 to 0.1 suits cameras at one distance."""
    homogenise_by: WeightKind = "ramp"
    """Frequency weight that --homogenise raises to a power: the ramp, which suits evenly spaced
    views, or one over the number of views that cover a frequency (coverage)."""
    band_limit: BandLimit | None = None
    """Lower limit on the size of splats: half a pixel of the closest camera (pixels, the 3D filter
    of Mip-Splatting), or what all cameras together resolve above the noise (coverage). Default:
    none."""
    hold_out: int = 8
    """Hold out every Nth view for evaluation (0 = none)."""
    views: int = 0
    """Train on this many views, evenly spaced (0 = all)."""
    checkpoint_every: int = 1000
    """Steps between two checkpoints, of which the last two are kept (0 = none)."""
    resume: bool = False
    """Resume from the last checkpoint in --out, to the same bits. With more --steps than before, a
    fit is trained on with the learning rates, densification and cooldown of a fit of that many
    steps, so that learning rates rise again before they fall."""
    config: Path | None = None
    """config.json of an earlier fit, whose settings are used where no option is given."""
    view: bool = False
    """Show the fit in a browser on this machine while it runs."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    overwrite: bool = False
    """Replace an earlier fit in --out."""
    dry_run: bool = False
    """Run a few steps, print what would be done, the time and the memory, and stop."""

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does.

        Raises:
            InputError: a setting is out of its range, or has no meaning beside the others.
        """
        if self.basis == "gaussian" and self.order is not None:
            raise InputError(
                f"--order is {self.order}, but Gaussian splats have no modes: add --basis hermite, "
                "or leave it out"
            )
        for name in ("hold_out", "views", "checkpoint_every"):
            self._check_least(name, 0)
        if self.homogenise_by == "coverage" and not self.exponent:
            raise InputError(
                "--homogenise-by coverage has no effect while the exponent is 0: add --homogenise "
                "0.5, say, or leave it out"
            )
        if self.resume and self.overwrite:
            raise InputError("--resume continues what --overwrite deletes: give one of them")

    def _check_least(self, name: str, bound: int) -> None:
        value = getattr(self, name)
        if value is not None and value < bound:
            option = name.replace("_", "-")
            raise InputError(f"--{option} is {value}, wanted {bound} or more")

    @property
    @abstractmethod
    def exponent(self) -> float:
        """Exponent of the frequency weight, where there are views enough for it."""

    @abstractmethod
    def training(self) -> TrainSettings:
        """The trainer's settings."""

    @abstractmethod
    def drawing(self) -> SplatSettings:
        """The rasterizer's settings."""

    def budget(self) -> int | None:
        """Bytes of memory that may be used; None if there is no limit but the machine's."""
        return None

    def asks_for_noise(self, exponent: float) -> bool:
        """Whether the noise of the views must be known, for this exponent."""
        return exponent > 0 or self.band_limit == "coverage"

    def basis_words(self) -> str:
        """What the splats are, in words; empty for Gaussians with harmonics."""
        training = self.training()
        basis, angular = training.basis, training.angular
        orders = {"shape": basis.order, "colour": basis.color_order}
        words = [f"{name} order {order}" for name, order in orders.items() if order]
        if words:
            words[0] = f"{basis.kind} splats of {words[0]}"
        words += [] if basis.activation == "clamp" else [f"activation {basis.activation}"]
        words += [] if angular.kind == "sh" else [f"{angular.modes} {angular.kind} functions"]
        return ", ".join(words)

    def basis_facts(self) -> dict[str, str]:
        """What the figures of a fit say of its splats; nothing for Gaussians with harmonics."""
        words = self.basis_words()
        return {"basis": words} if words else {}

    def decisive(self) -> dict[str, Any]:
        """What decides the result, as JSON: a resumed run must have the same."""
        values = {k: v for k, v in dataclasses.asdict(self).items() if k not in _FREE}
        return {name: _plain(value) for name, value in values.items()}

    def command(self) -> str:
        """The command line that resumes this fit."""
        words = ["rift", *self.job.split(), str(self.capture)]
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("capture", "config", "overwrite", "resume") or value == field.default:
                continue
            words.append("--" + field.name.replace("_", "-"))
            if not isinstance(value, bool):
                words += [str(entry) for entry in (value if isinstance(value, tuple) else (value,))]
        return shlex.join([*words, "--resume"])


def _plain(value: Any) -> Any:
    """A value as JSON holds it, with whole paths."""
    if isinstance(value, Path):
        return str(value.absolute())
    return [_plain(entry) for entry in value] if isinstance(value, tuple) else value
