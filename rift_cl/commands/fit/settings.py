"""The settings that ``rift fit photos`` and ``rift fit xray`` have in common."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, cast

from rift_cl.commands.options import without_place
from rift_cl.commands.run_folder.saved_settings import (
    begun_settings,
    options_of,
    parsed_settings,
)
from rift_cl.errors import InputError
from rift_cl.option_marks import RUN, Expert
from rift_cl.own_parts import decisive_parts
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.settings import TrainSettings

F = TypeVar("F", bound="FitSettings")
# Settings that may differ between a run and the one that resumes it: they change no bit of the
# result.
_FREE = (
    *("out", "resume", "overwrite", "dry_run", "view", "device", "config"),
    *("capture", "geometry"),
    *("checkpoint_every", "checkpoint_minutes", "memory", "format", "preset"),
)


@dataclass(frozen=True, kw_only=True)
class FitOutput:
    """What is written, and when."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-fit")
    """Folder for scene.ply, report.html, config.json, metrics.json and checkpoints."""
    checkpoint_every: Expert[int] = 1000
    """Steps between two checkpoints, of which the last two are kept (0 = none)."""
    checkpoint_minutes: Expert[float] = 10.0
    """Most minutes between two checkpoints (0 = by steps alone); without effect if
    --checkpoint-every is 0."""
    resume: Annotated[bool, RUN] = False
    """Resume from the last checkpoint in --out, to the same bits. With more --steps than before,
    the fit goes on with the learning rates, densification and cooldown of a fit of that many steps,
    so that learning rates rise again before they fall."""
    view: bool = False
    """Show the fit in a browser on this machine while it runs."""


class FitSettings:
    """What the settings of both commands can do; groups of options give them their fields."""

    # The command, as config.json names it.
    job: ClassVar[str]

    if TYPE_CHECKING:
        capture: Path
        out: Path
        training: TrainSettings
        rendering: SplatSettings
        hold_out: int | None
        views: int
        checkpoint_every: int
        checkpoint_minutes: float
        resume: bool
        view: bool
        device: str | None
        overwrite: bool
        dry_run: bool

    @classmethod
    def of(cls: type[F], capture: Path, out: Path, **options: Any) -> F:
        """Settings by the names of their options: ``steps=3000``, ``basis="hermite"``.

        Raises:
            InputError: there is no such option, or a value is none that it takes.
        """
        begun = begun_settings(None, options.get("preset"), cls.job, cls)
        given = {"capture": capture, "out": out, **options}
        return parsed_settings(given, cls.job, cls, earlier=begun)

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does.

        Raises:
            InputError: a setting is out of its range, or has no meaning beside the others.
        """
        for name in ("hold_out", "views", "checkpoint_every", "checkpoint_minutes"):
            self._check_least(name, 0)
        how = self.training.homogenisation
        if how.weight == "coverage" and how.exponent == 0:
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

    def decided(self: F, views: int) -> F:
        """These settings, with a value for what follows from the number of training views."""
        training = self.training.decided(views)
        rendering = replace(
            self.rendering,
            activation=training.basis.activation,
            angular=training.angular.kind,
        )
        found: F = replace(cast(Any, self), training=training, rendering=rendering)
        return found

    def budget(self) -> int | None:
        """Bytes of memory that may be used; None if there is no limit but the machine's."""
        return None

    def basis_words(self) -> str:
        """What the splats are, in words; empty for Gaussians with harmonics."""
        basis, angular = self.training.basis, self.training.angular
        orders = dict(zip(("shape", "colour"), basis.orders, strict=True))
        words = [f"{name} order {order}" for name, order in orders.items() if order]
        if words:
            words[0] = f"{basis.kind} splats of {words[0]}"
        words += [] if basis.activation == "clamp" else [f"activation {basis.activation}"]
        words += [] if angular.kind == "sh" else [f"{angular.modes} {angular.kind} functions"]
        light = self.training.environment
        words += [f"a shared light of {light.lobes} lobes"] if light.shared else []
        return ", ".join(words)

    def basis_facts(self) -> dict[str, str]:
        """What the figures of a fit say of its splats; nothing for Gaussians with harmonics."""
        words = self.basis_words()
        return {"basis": words} if words else {}

    def decisive(self) -> dict[str, Any]:
        """What decides the result, by the names of options: a resumed run must have the same.

        What is fitted is known by its contents (``rift_cl.commands.fit.inputs``).
        """
        return {
            option.name: _whole(without_place(option.name, option.value))
            for option in options_of(self)
            if not option.fixed and option.name not in _FREE
        } | decisive_parts()

    def command(self) -> str:
        """The command line that resumes this fit."""
        words = ["rift", *self.job.split(), str(self.capture)]
        for option in options_of(self):
            left_out = option.positional or option.fixed or option.value == option.default
            if left_out or option.name in ("config", "overwrite", "resume"):
                continue
            words += option.words()
        return shlex.join([*words, "--resume"])


def _whole(value: Any) -> Any:
    """A value as JSON holds it, with whole paths."""
    if isinstance(value, Path):
        return str(value.absolute())
    return [_whole(entry) for entry in value] if isinstance(value, tuple) else value
