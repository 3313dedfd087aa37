"""Folders of bare photographs for the tests, and a stand-in that poses them without pycolmap."""

from __future__ import annotations

from collections.abc import Generator

from rift_cl.io import PosedPhotographs
from rift_cl.progress import Report

# In the order of their code points.
NAMES = ["a b.png", "c.PNG", "z'\"$;.png", "ü 日本.png"]


def run(
    work: Generator[Report, None, PosedPhotographs],
) -> tuple[list[Report], PosedPhotographs]:
    """What is reported, and what comes out."""
    reports = []
    while True:
        try:
            reports.append(next(work))
        except StopIteration as end:
            return reports, end.value
