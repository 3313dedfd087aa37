"""What long work tells its caller between two steps.

The library prints nothing and draws no bar: everything that takes a while is a generator of
``Report`` records, and whoever runs it decides what to show. Between two reports kernels may have
to be built, which can take longer than the step itself: ``BUILDS`` says so to whoever asks then.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape


@dataclass(frozen=True)
class Report:
    """Where a piece of work stands.

    Args:
        done: steps that are finished.
        total: steps in all.
        what: what the steps are, in the plural, such as "slices".
        values: figures worth showing, by name.
        work: where steps do not cost the same: what was done and what there is in all, in any
            unit that is in proportion to the time that it takes.
    """

    done: int
    total: int
    what: str
    values: Mapping[str, float] = field(default_factory=dict)
    work: tuple[float, float] | None = None

    def _repr_html_(self) -> str:
        """What a notebook shows: a bar, and the figures."""
        named = [f"{name} {value:.6g}" for name, value in self.values.items()]
        words = escape(", ".join([f"{self.done}/{self.total} {self.what}", *named]))
        bar = f"<progress aria-label='Progress' value='{self.done}' max='{max(self.total, 1)}'>"
        return f"<div>{bar}</progress> {words}</div>"


class Builds:
    """Kernels that this process builds, one at a time; any thread may ask."""

    def __init__(self) -> None:
        self.kernels = 0
        """How many were built."""
        self._seconds = 0.0
        self._now: tuple[str, float] | None = None

    @property
    def now(self) -> str:
        """The kernel that is being built, empty for none."""
        now = self._now
        return "" if now is None else now[0]

    @property
    def seconds(self) -> float:
        """Seconds that all builds have taken, the one at work included."""
        seconds, now = self._seconds, self._now
        return seconds if now is None else seconds + time.monotonic() - now[1]

    @contextmanager
    def of(self, kernel: str) -> Iterator[None]:
        """Count what is done inside as the building of a kernel."""
        began = time.monotonic()
        self._now = kernel, began
        try:
            yield
        finally:
            self._now = None
            self._seconds += time.monotonic() - began
            self.kernels += 1


BUILDS = Builds()
