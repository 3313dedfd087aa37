"""From which size of the images a fit begins, and for how long it stays there.

Halving an image leaves out the highest octave of its frequencies. While the residual of a fit is
larger than what that octave holds, the octave is not what is missing: steps on the halved images
are cheaper and tell as much. Both are measured, so that the lengths of the levels follow from the
images. (Coarse to fine is how DashGaussian, Chen et al. 2025, is faster; its schedule is another.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from tyro.conf import arg

from rift_cl.errors import SettingError
from rift_cl.geometry import Camera
from rift_cl.option_marks import Expert
from rift_cl.train.ranges import check_number, check_whole

# Pixels of an image from which on it is halved at first, and of the smallest that it is halved to.
_LARGE, _SMALLEST = 250_000, 8_000
# Pixels along the shorter side of the smallest: SSIM wants a window of 11.
_SHORTEST = 16


@dataclass(frozen=True)
class OctaveSettings:
    """How often images are halved at first.

    Raises:
        InputError: a number is out of its range.
    """

    count: Annotated[int | None, arg(name="octaves", prefix_name=False, help_behavior_hint="")] = (
        None
    )
    """Number of times that images are halved at first (0 = full size from the first step on). Each
    halving leaves out the highest octave of their frequencies, and ends when the residual is
    smaller than what that octave holds. Default: for images of 250,000 pixels and more, as often
    as leaves 8,000 pixels, otherwise 0."""
    last: Expert[float] = 0.6
    """Fraction of the run after which images have their full size at the latest; images that are
    halved twice end after half of that, and so on."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        if self.count is not None:
            check_whole(self, "count", 0, 16)
        check_number(self, "last", most=1)

    def decided(self, cameras: Sequence[Camera]) -> OctaveSettings:
        """These settings, with a number for these cameras where it was left open.

        Raises:
            SettingError: images would become too small.
        """
        shortest = min(min(camera.size) for camera in cameras)
        pixels = min(camera.height * camera.width for camera in cameras)
        if self.count is None:
            count = 0
            while (
                pixels >= _LARGE
                and pixels >> 2 * (count + 1) >= _SMALLEST
                and shortest >> (count + 1) >= _SHORTEST
            ):
                count += 1
            return replace(self, count=count)
        if self.count and shortest >> self.count < _SHORTEST:
            raise SettingError(
                self,
                "count",
                f"is {self.count}, which leaves {shortest >> self.count} pixels along the shorter "
                f"side of an image, wanted {_SHORTEST} or more",
            )
        return self

    def latest(self, level: int, steps: int) -> int:
        """The step with which images stop being halved ``level`` times at the latest."""
        return round(self.last * steps * 0.5 ** (level - 1))
