"""Split of views into training and test views."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from rift_cl.errors import InputError
from rift_cl.io.captures.capture import Capture, View, as_pinholes, open_capture

One = TypeVar("One")
# Photographs up to which none is held out: two tell of depth, one does not.
FEWEST_VIEWS = 2
# One in so many is held out where nobody says otherwise.
EVERY = 8


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
    return _thinned(training, count, what), test


def split_photographs(
    views: tuple[View, ...], hold_out: int | None, count: int
) -> tuple[tuple[View, ...], tuple[View, ...]]:
    """Photographs to train on and to hold out.

    Args:
        views: all of them.
        hold_out: every so-many-th is held out, 0 for none; None follows the capture's lists.
        count: train on so many, evenly spaced among those to be trained on; 0 for all.

    Raises:
        InputError: nothing is left to train on, or there are fewer than ``count``.
    """
    if hold_out is not None:
        return split_views(views, hold_out, count)
    training, test = (
        tuple(view for view in views if view.split == split) for split in ("train", "test")
    )
    if not training:
        raise InputError(
            "the capture's lists of photographs leave none to train on: --hold-out 8, say, is "
            "followed in their place"
        )
    return _thinned(training, count, "photograph"), test


def follows_lists(views: Sequence[View]) -> bool:
    """Whether a capture says which of its photographs are trained on and which are scored."""
    return any(view.split for view in views)


def _thinned(training: tuple[One, ...], count: int, what: str) -> tuple[One, ...]:
    if count > len(training):
        raise InputError(f"--views is {count}, there are {len(training)} {what}s to train on")
    if not count:
        return training
    return tuple(training[int(k)] for k in np.arange(count) * len(training) / count)
