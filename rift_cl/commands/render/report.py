"""The report of ``rift render``: a contact sheet of the frames, and an animation of some."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.render.animation import animated_png, animated_webp
from rift_cl.io.output import atomic_path
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png, image_grid, jpeg

Codes = NDArray[np.uint8]

# Frames on the contact sheet, in a row of it, and in the animation.
_SHOWN, _ROW, _MOVING = 12, 4, 240
# Pixels along the longer side of a frame in the report.
_PANEL = 640
# The report holds an animation of so many bytes or fewer.
_EMBEDDED = 4 << 20


class Sheet:
    """Small copies of those frames that are shown, evenly spaced among all.

    Args:
        total: how many frames there will be.
        maps: what is shown of a frame beside its colours, by name.
    """

    def __init__(self, total: int, maps: Sequence[str] = ()) -> None:
        self.maps = tuple(maps)
        self._shown = _even(total, _SHOWN)
        self._moving = _even(total, _MOVING)
        self._share = len(self._moving) / total
        self._stills: list[tuple[str, list[Codes]]] = []
        self._film: list[Codes] = []

    def add(self, number: int, pictures: Sequence[Codes]) -> None:
        """Take a frame: its colours, and its maps."""
        if number in self._shown:
            self._stills.append((f"{number:04}", list(pictures)))
        if number in self._moving:
            self._film.append(pictures[0])

    def contact(self) -> bytes:
        """The contact sheet as the content of a PNG file; maps below their frame."""
        images, titles = [], []
        for first in range(0, len(self._stills), _ROW):
            row = self._stills[first : first + _ROW]
            # A short last row is filled up, so that maps stay below their frame.
            blank = [np.ones((1, 1, 3))] * (min(_ROW, len(self._stills)) - len(row))
            for kind in range(len(row[0][1])):
                images += [pictures[kind] / 255 for _, pictures in row] + blank
                titles += [name if kind == 0 else "" for name, _ in row] + [""] * len(blank)
        columns = min(_ROW, len(self._stills))
        return figure_png(image_grid(images, titles=titles, columns=columns, window=(0.0, 1.0)))

    def panels(self) -> tuple[list[bytes], list[str]]:
        """The frames that are shown as JPEG files, each with its maps after it, and titles."""
        cells, titles = [], []
        for name, pictures in self._stills:
            cells += [jpeg(picture / 255, side=_PANEL) for picture in pictures]
            titles += [name, *(f"{name}, {shown}" for shown in self.maps)]
        return cells, titles

    def moving(self, rate: float) -> bytes:
        """The animation as the content of a PNG file."""
        return animated_png(self._film, rate * self._share)

    def embedded(self, rate: float) -> bytes:
        """The animation as the content of a smaller WebP file."""
        return animated_webp(self._film, rate * self._share)


def render_page(name: str, sheet: Sheet, moving: bytes | None, metrics: Mapping[str, Any]) -> Page:
    """The report of a finished rendering; ``moving`` is a small copy of its film."""
    page = Page(f"Rendering of {name}", f"{metrics['frames']} frames, {metrics['splats']} splats")
    if moving is not None and len(moving) <= _EMBEDDED:
        caption = f"A smaller copy of the film, {metrics['film']}."
        page.figure(moving, caption=caption, alt="Animation of the frames")
    depth = metrics["depth_window"]
    caption = "Some of the frames, by number."
    if depth is not None:
        caption += f" Depth beside: bright at {depth[0]:.4g}, dark at {depth[1]:.4g} scene units."
    if "normals" in sheet.maps:
        caption += " Normals beside: red, green, blue are x, y, z from -1 to 1."
    cells, titles = sheet.panels()
    page.panels(cells, titles=titles, columns=_ROW, caption=caption, alt="Frame")
    facts = {"centre": metrics["center"], "up": metrics["up"]}
    page.section("Scene")
    page.facts(
        {"radius": metrics["radius"], "eps2d": metrics["eps2d"]}
        | {key: ", ".join(f"{v:.4g}" for v in value) for key, value in facts.items()}
    )
    if depth is not None:
        page.paragraph(
            "depth/*.exr hold the expected depth along the camera's axis in scene units as "
            "float32, 0 where there is nothing; depth/*.png show it in colour."
        )
    if "normals" in sheet.maps:
        page.paragraph(
            "normals/*.exr hold unit normals x, y, z in the scene's axes as float32, 0 where there "
            "is nothing: the mean of the splats' shortest axes; normals/*.png show them in colour."
        )
    return page


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    with atomic_path(path) as part:
        part.write_bytes(content)


def _even(total: int, count: int) -> frozenset[int]:
    """So many numbers below ``total``, evenly spaced; all of them where there are fewer."""
    return frozenset((np.arange(min(total, count)) * total // min(total, count)).tolist())
