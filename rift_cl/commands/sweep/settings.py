"""The settings of ``rift sweep``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.commands.options import SpreadRun
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto, Several


@dataclass(frozen=True)
class SweepInput:
    """What is run, and what is varied."""

    group: ClassVar[str] = "input"

    command: Annotated[Literal["reconstruct", "fit", "plan"], Positional]
    """The command that is run many times: 'rift reconstruct', 'rift fit' or 'rift plan'."""
    inputs: Annotated[tuple[Path, ...], Positional]
    """Scans or captures, each of which is run with all settings. Those of 'rift plan' are its
    --have, and may be left out."""
    vary: Several[str] = ()
    """Settings to try, each as NAME=VALUE,VALUE,..., such as method=fbp,cgls steps=10,20: every
    combination is a run. Names are those of the command's options; a value of several numbers is in
    quotes, such as 'rows=0 16,16 32'."""
    fixed: Several[str] = ()
    """Settings of all runs, each as NAME=VALUE, such as center=295.5."""
    base: Auto[Path] = None
    """config.json of a run of the command, whose settings are those of all runs where nothing else
    is given."""


@dataclass(frozen=True, kw_only=True)
class SweepOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-sweep")
    """Folder for report.html, sweep.csv with a line for each run, config.json and metrics.json;
    each run has a folder of its own in it, under runs."""


@dataclass(frozen=True)
class SweepSettings(SpreadRun, SweepOutput, SweepInput):
    """Run a command with many settings or inputs, and compare the results in one table.

    Example: rift sweep reconstruct scan.h5 --vary filter=ram-lak,hann cutoff=0.5,1 --out compared
    """

    def check(self) -> None:
        """Check what depends on nothing but the settings.

        Raises:
            InputError: there is no input, or two options contradict each other.
        """
        self.check_cluster()
        if not self.inputs and self.command != "plan":
            raise InputError("a sweep wants a scan or a capture: name one or more")
        if self.resume and self.overwrite:
            raise InputError("--resume continues what --overwrite discards: give one of them")
