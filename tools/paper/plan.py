"""What the figures are computed with: sizes, lengths of the fits, and the captures they need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.errors import InputError
from rift_cl.sample import ornament, ornament_off_path

# Splats gain this variance on the screen, in square pixels: all cameras keep about one distance.
EPS2D = 0.05
# The settings that all figures of the documents were made with.
PRESET = "0.1"
_HOW = (
    "make it with 'python tools/render_ornament.py --views 570 --out DIR/orbit' and "
    "'python tools/render_ornament.py --off-path --views 24 --samples 768 --out DIR/off_path'"
)


@dataclass(frozen=True)
class Ornament:
    """Captures of one scene.

    Args:
        ring: views evenly along a closed ring, in order.
        off_path: views from elsewhere.
        test: every 8th view of the ring again, with less noise; None to take those of the ring.
    """

    ring: Path
    off_path: Path
    test: Path | None


@dataclass(frozen=True)
class Plan:
    """How the figures are computed.

    Args:
        full: the paper's sizes.
        out: folder of the results; fits are in ``fits`` there.
        device: the device's name as the user gave it.
        ornament: what splats are fitted to; None where it was not given.
        counts: numbers of input views, rising.
        steps: of a fit.
        splats: most splats of a fit.
        seeds: of the fits whose spread is looked at; the first is that of all others.
        noises: standard deviations of noise in the pictures, of the fits with and without
            homogenisation; all others have none.
    """

    full: bool
    out: Path
    device: str | None
    ornament: Ornament | None
    counts: tuple[int, ...]
    steps: int
    splats: int
    seeds: tuple[int, ...]
    noises: tuple[float, ...] = (0.0,)

    @property
    def captures(self) -> Ornament:
        """What splats are fitted to.

        Raises:
            InputError: there is nothing.
        """
        if self.ornament is None:
            raise InputError(self.missing())
        return self.ornament

    @staticmethod
    def missing() -> str:
        """What to do where there are no captures."""
        return f"--full wants --ornament DIR with the captures orbit and off_path; {_HOW}"

    def fits(self) -> dict[str, Any]:
        """What decides the result of a fit, but for views, ramp and seed; JSON."""
        return {
            "capture": str(self.captures.ring.absolute()),
            "steps": self.steps,
            "splats": self.splats,
            "eps2d": EPS2D,
        }

    def size(self) -> dict[str, Any]:
        """The settings of a figure that has no others; JSON."""
        return {"size": "full" if self.full else "quick"}


def sample_ornament() -> Ornament:
    """The small captures that come with the package."""
    return Ornament(ornament(), ornament_off_path(), None)


def find_ornament(folder: Path) -> Ornament:
    """The captures in a folder that the user named.

    Raises:
        InputError: one is missing.
    """
    for name in ("orbit", "off_path"):
        if not (folder / name / "transforms.json").is_file():
            raise InputError(f"--ornament {folder}: there is no {name}/transforms.json; {_HOW}")
    test = folder / "orbit_test"
    return Ornament(
        folder / "orbit",
        folder / "off_path",
        test if (test / "transforms.json").is_file() else None,
    )
