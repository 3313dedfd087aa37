"""How large pictures may be that are to be drawn in time."""

from __future__ import annotations

import math

from rift_cl.commands.view.pose import NARROWEST, Pose

# Seconds that a picture of a moving camera should take, and that one of half the size may take.
_PICTURE, _SLOW = 0.05, 0.25
# The least longer edge of a picture, and how many sizes there are up to the full one.
_LEAST, _SIZES = 96, 8


class Pace:
    """How many pixels are drawn and sent in a second; None before the first picture."""

    def __init__(self) -> None:
        self.pixels: float | None = None

    def learn(self, pixels: int, seconds: float) -> None:
        """Note what a picture took; one that had to wait for something else says little."""
        now = pixels / seconds
        self.pixels = now if self.pixels is None else math.sqrt(now * self.pixels)

    def edge(self, pose: Pose, full: int) -> int:
        """The longer edge in pixels at which a moving camera's picture is drawn in time.

        At least half of what it is at rest, unless that took all too long; in few steps, since a
        picture that changes its size all the time flickers.

        Args:
            pose: whose window has a shape.
            full: the longer edge at rest.
        """
        if self.pixels is None:
            return min(full, max(_LEAST, full // 2))
        share = max(min(pose.aspect, 1 / pose.aspect), NARROWEST)
        soon, late = (math.sqrt(self.pixels * limit / share) for limit in (_PICTURE, _SLOW))
        step = full / _SIZES
        fits = max(step * int(soon / step), min(full / 2, late))
        return min(full, max(_LEAST, int(fits)))
