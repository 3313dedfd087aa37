"""Split of views into training and test views."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import numpy as np

from rift_cl.errors import InputError
from rift_cl.io.captures.capture import Capture, as_pinholes, open_capture

One = TypeVar("One")
# Photographs up to which none is held out: two tell of depth, one does not.
FEWEST_VIEWS = 2


def open_seen(path: Path, *, pinhole: bool) -> Capture:
    """A capture, through lenses that it names or, if ``pinhole``, as if none had an opening."""
    capture = open_capture(path)
    return as_pinholes(capture) if pinhole else capture


def split_views(
    views: tuple[One, ...], hold_out: int, count: int, *, what: str = "photograph"
) -> tuple[tuple[One, ...], tuple[One, ...]]:
    """The views to train on, and those that are held out: every ``hold_out``-th.

    Args:
        views: all of them, in the capture's order.
        hold_out: 0 for none.
        count: train on so many, evenly spaced among the rest; 0 for all.
        what: what a view is called.

    Raises:
        InputError: nothing is left to train on, or there are fewer than ``count``.
    """
    training = tuple(v for k, v in enumerate(views) if not hold_out or k % hold_out)
    test = tuple(v for k, v in enumerate(views) if hold_out and k % hold_out == 0)
    if not training:
        raise InputError(f"--hold-out {hold_out} leaves no {what} to train on")
    if count > len(training):
        raise InputError(f"--views is {count}, there are {len(training)} {what}s to train on")
    if count:
        training = tuple(training[int(k)] for k in np.arange(count) * len(training) / count)
    return training, test
