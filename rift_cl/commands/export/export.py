"""``rift export``: one file out of a scene, and a sentence for each thing that it cannot hold.

``rift_cl/io/scenes/formats`` makes the bytes, a file for each format.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_args

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.export.axes import check_scale, scaled, turn_between, turned
from rift_cl.commands.export.plain_scene import plain_scene
from rift_cl.commands.export.settings import ExportSettings, Target
from rift_cl.commands.export.web_page import FirstView, web_page
from rift_cl.commands.inputs.opened_scene import in_display_light, scene_file
from rift_cl.errors import InputError, OutputError
from rift_cl.io.output import atomic_path, check_space
from rift_cl.io.scenes.formats.formats import DEGREE, FORMATS, SplatFormat
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.progress import Report

_PAGE = ".html"
# What people call films, which are another command's.
_FILMS = (".webm", ".mp4", ".gif", ".webp", ".png", ".apng")
# An extension that two formats have, and the one that is meant where --to says so.
_BOTH_PLY = ("ply", "compressed-ply")
_UP = np.array([0.0, 1, 0])
# What viewers add to splats on the screen, in square pixels.
_VIEWERS = 0.3


class Export:
    """An export that is planned; nothing is written yet.

    ``plain`` is the scene as it will be written but for ``turn`` (3, 3) and the scale, which come
    last, and ``notes`` what is lost by it.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scene cannot be read, the format cannot hold it, or the file is there.
    """

    def __init__(self, settings: ExportSettings) -> None:
        self.settings = settings
        self.announce: Callable[[str], None] = lambda sentence: None
        check_scale(settings.scale)
        self.scene = settings.open_scene()
        self.format = self._format(format_name(settings, "html"))
        if self.format.suffix == _PAGE and settings.scale != 1:
            raise InputError("a page looks the same at any --scale: leave it out")
        self.path = output_path(settings, self.format.suffix)
        self._bounds = settings.bounds(self.scene)
        self.plain, self.notes = plain_scene(self.scene.splats, self._bounds.cameras)
        if self.plain.degree > DEGREE:
            kept = np.ascontiguousarray(self.plain.sh[:, : (DEGREE + 1) ** 2])
            self.plain = dataclasses.replace(self.plain, sh=kept)
            self.notes.append(f"harmonics of degree {DEGREE + 1} are left out")
        self.notes += settings.notes(self.scene)
        self.turn = np.eye(3)
        if self.format.upright:
            self.turn = turn_between(self._bounds.up, _UP)
            self.notes.append(self._turn_note())
        if self.format.suffix == _PAGE and self.plain.degree:
            self.notes.append(
                "the page draws each splat in one colour, the mean of what the cameras saw: what "
                "changes with the direction is lost (other formats keep it; a fit with "
                "--sh-degree 0 has nothing to lose by it)"
            )
        self.notes += self.format.notes(self._written())
        self.notes += self._blur_notes()

    def _turn_note(self) -> str:
        """Which way was up, and how that is known."""
        # Rounding leaves a little beside an axis; 0 is added against a minus sign.
        x, y, z = self._bounds.up.round(4) + 0.0
        note = f"the scene is turned so that up, ({x:.3g}, {y:.3g}, {z:.3g}), is y"
        if self._bounds.cameras or self.settings.up is not None:
            return note
        return (
            f"{note}; up is guessed from the splats, since no cameras tell: --up or "
            "--capture says it"
        )

    def _written(self) -> SplatScene:
        """The splats as the format is given them."""
        return scaled(turned(self.plain, self.turn), self.settings.scale)

    def _blur_notes(self) -> list[str]:
        """What viewers make of splats on the screen that the fit did not."""
        eps2d, notes = self.scene.rendering.eps2d, list[str]()
        if eps2d != _VIEWERS:
            notes.append(
                f"viewers blur by {_VIEWERS:g} square pixels, the scene was fitted with "
                f"{eps2d:g}: pictures smaller than the photographs look softer"
            )
        if self.scene.rendering.antialiased:
            told = (
                "the file says so, but viewers that do not heed it"
                if self.format.antialiased
                else "no field of the format says so, and viewers"
            )
            notes.append(
                "the scene was fitted antialiased, with splats dimmed as blur widens them "
                f"(Mip-Splatting): {told} draw small splats too opaque, unless antialiasing is "
                "switched on in them (fit without --rendering.antialiased what is to be shown "
                "elsewhere)"
            )
        return notes

    def _format(self, name: str) -> SplatFormat:
        if name == "html":
            rounds = "colours to one for all directions and 8 bits, covariances to half floats"
            return SplatFormat(_PAGE, self._page, False, rounds)
        if name not in FORMATS:
            raise InputError(f"--to {name} is about triangles: add --mesh")
        return FORMATS[name]

    def _page(self, scene: SplatScene) -> bytes:
        """A page that begins at a photograph's view, where the cameras are known."""
        camera, target = first_view(self._bounds)
        first = FirstView(camera, target, self._bounds.up)
        behind = in_display_light(self.scene.background, self.scene.light)
        return web_page(
            scene, first, self._bounds.cameras, title=self.scene.name, background=behind
        ).encode()

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        scene = self.plain
        facts = {
            "scene": f"{self.scene.name}, {len(self.scene.splats)} splats",
            "output": str(self.path),
            "splats": f"{len(scene)}, harmonics of degree {scene.degree}",
            "rounded": self.format.rounds,
        }
        return facts | {f"note {n}": note for n, note in enumerate(self.notes, 1)}

    def run(self) -> Iterator[Report]:
        """Do it; a report at the end."""
        for note in self.notes:
            self.announce(note)
        content = self.format.encode(self._written())
        write_whole(self.path, content)
        self.result = f"{self.path}, {format_bytes(len(content))}"
        yield Report(len(self.plain), len(self.plain), "splats")


def format_name(settings: ExportSettings, usual: str) -> str:
    """The format that is asked for: ``--to``, or else the extension of the file to write.

    Raises:
        InputError: no format has this extension, or another than the one that --to names.
    """
    by_suffix = None if settings.out is None else _format_of(settings.out)
    if settings.to is not None:
        # A compressed PLY is one by its content: programs know it whatever comes before .ply.
        if by_suffix not in (None, settings.to) and (by_suffix, settings.to) != _BOTH_PLY:
            raise InputError(
                f"--to {settings.to} contradicts the extension of --out {settings.out}, which is "
                f"that of {by_suffix}: leave out --to, or name another file"
            )
        return settings.to
    if by_suffix is not None:
        return by_suffix
    if settings.out is None or not settings.out.suffix:
        return usual
    film = settings.out.suffix.lower() in _FILMS
    raise InputError(
        f"{settings.out}: no export has the extension {settings.out.suffix}: name the format "
        + ("(--to), or make a film by 'rift render'" if film else "(--to)")
    )


def _format_of(path: Path) -> str | None:
    """The format whose extension a file has; None where no format has it."""
    names: tuple[str, ...] = get_args(Target)
    suffixes = {name: "." + name.replace("-", ".") for name in names}
    # The longer ones first: .compressed.ply ends in .ply as well.
    for name, suffix in sorted(suffixes.items(), key=lambda pair: -len(pair[1])):
        if path.name.lower().endswith(suffix):
            return name
    return None


def output_path(settings: ExportSettings, suffix: str) -> Path:
    """Where the file goes.

    Raises:
        OutputError: a file is there already, or it is the scene itself.
    """
    path = settings.out
    if path is None:
        name = settings.scene.resolve().name
        path = Path((name if settings.scene.is_dir() else Path(name).stem) + suffix)
    if path.exists() and path.samefile(scene_file(settings.scene)):
        raise OutputError(f"{path}: is the scene itself; name another file (--out)")
    if path.exists() and not settings.overwrite:
        raise OutputError(f"{path}: is there already; name another file (--out) or add --overwrite")
    return path


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that appears complete or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    check_space(path, len(content))
    with atomic_path(path) as part:
        part.write_bytes(content)
