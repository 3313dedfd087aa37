"""How many files of the package one call enters: how far a reader has to walk to follow it.

    python tools/count_walk.py [--files]

Counted are the functions of ``rift_cl`` that one step of a trainer, one picture of a renderer and
one ``rift reconstruct`` call, by ``sys.setprofile``: the files that they stand in, and how often a
call leads from one file to another. Kernels are built and caches filled before counting begins.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from rift_cl.commands.cli import main as command
from rift_cl.geometry import Camera
from rift_cl.train import Parameters, Trainer, TrainSettings, start_splats

_PACKAGE = Path(rift.__file__).parent
_SIZE, _VIEWS = 32, 4
# Steps after which harmonics of all degrees have joined, and no kernel is new.
_WARM = 4


@dataclass(frozen=True)
class Options:
    """Count the files that three calls enter.

    Args:
        files: name every file, with the number of calls that lead into it.
    """

    files: bool = False


class Still:
    """Grey images from a ring of cameras; see ``rift_cl.train.Pictures``."""

    def __init__(self, device: rift.Device) -> None:
        self.cameras = [_on_ring(number) for number in range(_VIEWS)]
        self._grey = device.array(np.full((_SIZE, _SIZE, 3), 0.5))
        self._black = device.zeros((3,))

    def begin(self, step: int) -> None:
        """Nothing is prepared."""

    def target(self, number: int) -> Any:
        """The same for all."""
        return self._grey

    def weights(self, number: int) -> Any:
        """None: all pixels count alike."""

    def background(self, number: int) -> Any:
        """The same for all."""
        return self._black


def walk(call: Callable[[], object]) -> Counter[Path]:
    """Calls from one file of the package into another, by the file that is entered."""
    entered: Counter[Path] = Counter()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event != "call":
            return
        file, caller = Path(frame.f_code.co_filename), frame.f_back
        above = Path(caller.f_code.co_filename) if caller else None
        if _PACKAGE in file.parents and file != above:
            entered[file.relative_to(_PACKAGE)] += 1

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return entered


def walks(folder: Path) -> dict[str, Counter[Path]]:
    """What is counted, by name."""
    device = rift.default_device()
    pictures, points = Still(device), np.random.default_rng(0).uniform(-0.5, 0.5, (60, 3))
    settings = TrainSettings(steps=10, splats=60)
    trainer = Trainer(pictures, Parameters.of(device, start_splats(points, None)), settings)
    for _ in range(_WARM):
        trainer.step()
    splats, renderer = trainer.parameters.drawn, rift.Renderer(device=device)
    renderer.forward(splats, pictures.cameras[0])
    angles = np.arange(36) * np.pi / 36
    scan = rift.Parallel(angles, _SIZE, 1.0)
    sinogram = rift.phantom.shepp_logan_sinogram(rift.Grid((_SIZE, _SIZE), 1.0), scan)
    np.savez(folder / "scan.npz", projections=0.01 * sinogram[:, None], angles=angles)

    def reconstruct() -> None:
        out = folder / "reconstruction"
        command(["reconstruct", str(folder / "scan.npz"), "--out", str(out), "--overwrite"])

    reconstruct()
    return {
        "Trainer.step": walk(trainer.step),
        "Renderer.forward": walk(lambda: renderer.forward(splats, pictures.cameras[0])),
        "rift reconstruct": walk(reconstruct),
    }


def main(options: Options) -> None:
    """Count, and print."""
    with tempfile.TemporaryDirectory() as folder:
        found = walks(Path(folder))
    for name, entered in found.items():
        print(f"{name}: {len(entered)} files, {entered.total()} moves from file to file")
        for file, calls in sorted(entered.items()) if options.files else ():
            print(f"    {calls:6} {file.as_posix()}")


def _on_ring(number: int) -> Camera:
    turn = 2 * np.pi * number / _VIEWS
    view = np.eye(4)
    view[0, 0] = view[2, 2] = np.cos(turn)
    view[0, 2], view[2, 0], view[2, 3] = np.sin(turn), -np.sin(turn), 4
    return Camera((_SIZE, _SIZE), [[_SIZE, 0, _SIZE / 2], [0, _SIZE, _SIZE / 2], [0, 0, 1]], view)


if __name__ == "__main__":
    main(tyro.cli(Options))
