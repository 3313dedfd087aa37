"""Captures of many photographs: steps of training where all are kept, and where they are streamed.

``1000:480x360:128M`` are a thousand photographs of the fitted ornament (``bench/splat_scenes.py``),
drawn by ourselves from all sides and kept as JPEG, and steps of a fit to them within 128 MiB.
Photographs for which there is no room are decoded again whenever a step asks for them, as in
``rift fit``; all steps that are measured there ask for such ones, as long as there are some left.
"""

from __future__ import annotations

import json
import math
import os
import re
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rift_cl as rift
from bench.splat_scenes import DrawnScene
from bench.table import Table
from rift_cl.cl.budget import parse_bytes
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io import open_capture
from rift_cl.io.images.pixels import write_pixels
from rift_cl.splat import Renderer, Splats
from rift_cl.train import McmcSettings, Parameters, Trainer, TrainSettings

# A run that is much longer than what is measured, without relocations.
_RUN = 30_000
# Steps in a turn, and those before anything counts.
_STEPS, _WARM = 25, 4
# Cameras lie on so many rings, from so far below the scene to so far above it, in degrees.
_RINGS, _LOWEST, _HIGHEST = 5, -20.0, 60.0


@dataclass(frozen=True)
class PhotographsCase:
    """A capture that is made for the benchmark.

    Args:
        name: as ``parse`` reads it.
        count: photographs.
        size: (height, width) in pixels.
        memory: bytes that a fit may take.
    """

    name: str
    count: int
    size: tuple[int, int]
    memory: int

    @classmethod
    def parse(cls, text: str) -> PhotographsCase:
        """Read ``1000:480x360:128M``.

        Raises:
            InputError: the text is no such thing.
        """
        match = re.fullmatch(r"([1-9]\d*):(\d+)x(\d+):(\w+)", text.strip())
        if match is None or min(int(match[2]), int(match[3])) < 16:
            raise InputError(
                f"photographs are {text!r}, wanted COUNT:WIDTHxHEIGHT:MEMORY such as "
                "1000:480x360:128M, at least 16 x 16"
            )
        size = int(match[3]), int(match[2])
        return cls(text.strip(), int(match[1]), size, parse_bytes(match[4]))

    def write(self, folder: Path, device: rift.Device) -> None:
        """Draw the photographs and write them with their cameras."""
        scene = DrawnScene.parse(f"fitted:{self.size[1]}x{self.size[0]}")
        splats, renderer = Splats.upload(device, **scene.parameters), Renderer(device=device)
        middle = np.median(scene.parameters["means"], axis=0).astype(float)
        size, K, view = scene.lens
        distance = float(np.linalg.norm(np.linalg.inv(view.astype(float))[:3, 3] - middle))
        frames = []
        for number in range(self.count):
            world = _around(number, self.count, middle, distance)
            frame = renderer.forward(splats, Camera(size, K, np.linalg.inv(world)))
            codes = np.rint(np.clip(device.get(frame.image), 0, 1) * 255).astype(np.uint8)
            name = f"{number:05d}.jpg"
            write_pixels(folder / name, codes, format="jpeg", attributes={})
            # The file has OpenGL's axes: up and backwards.
            pose = world @ np.diag([1.0, -1.0, -1.0, 1.0])
            frames.append({"file_path": name, "transform_matrix": pose.tolist()})
        lens = {"fl_x": K[0][0], "fl_y": K[1][1], "cx": K[0][2], "cy": K[1][2]}
        record = {"w": size[1], "h": size[0], **lens, "frames": frames}
        (folder / "transforms.json").write_text(json.dumps(record), encoding="utf-8")


def _around(number: int, count: int, middle: Any, distance: float) -> Any:
    """Camera to world (4, 4) of a place on the rings, looking at the middle."""
    ring = number % _RINGS
    up = math.radians(_LOWEST + (_HIGHEST - _LOWEST) * ring / (_RINGS - 1))
    turn = 2 * math.pi * number / count
    outward = np.array([math.cos(up) * math.cos(turn), math.cos(up) * math.sin(turn), math.sin(up)])
    right = np.array([-math.sin(turn), math.cos(turn), 0.0])
    world = np.eye(4)
    world[:3, :3] = np.stack([right, np.cross(-outward, right), -outward], axis=1)
    world[:3, 3] = middle + distance * outward
    return world


class Fitting:
    """A fit to a capture, and its steps.

    Args:
        folder: the capture.
        device: where to fit, with its limit of memory.
        splats: the first splats, as ``Parameters.of`` takes them.
    """

    def __init__(self, folder: Path, device: rift.Device, splats: dict[str, Any]) -> None:
        self.device = device
        views = open_capture(folder).views
        self.pictures = CapturePictures(device, views)
        settings = TrainSettings(
            steps=_RUN,
            splats=len(splats["means"]),
            sh_degree=3,
            noise=0.0,
            strategy=McmcSettings(first=_RUN),
        )
        self.trainer = Trainer(self.pictures, Parameters.of(device, splats), settings)
        self.pictures.announce(self.trainer.view_at)
        self.kept = 0
        while self.kept < len(views) and self.pictures.keep(self.trainer.view_at(self.kept)):
            self.kept += 1
        # From here on to the end of a turn through all of them, none is kept.
        self.trainer.parameters.step = self.kept % len(views)
        self.most = 0
        self.turns: list[tuple[float, float]] = []

    def turn(self, steps: int = _STEPS) -> None:
        """Take steps; keep the processor time a core of one, and the time on the clock."""
        self.device.finish()
        began = time.process_time(), time.perf_counter()
        for _ in range(steps):
            self.trainer.step()
        self.device.finish()
        ended = time.process_time(), time.perf_counter()
        cpu, clock = (end - begin for begin, end in zip(began, ended, strict=True))
        self.turns.append((cpu / steps / (os.cpu_count() or 1), clock / steps))
        self.most = max(self.most, self.device.taken)

    def record(self) -> dict[str, Any]:
        """What was measured."""
        photographs = sum(kept.nbytes for kept in self.pictures._kept.values())
        return {"kept": self.kept, "seconds": self.turns, "bytes": [self.most, photographs]}


def measure(case: PhotographsCase, selector: str, rounds: int) -> dict[str, Any]:
    """The record of a capture: fits with and without room for its photographs, in turns."""
    with _capture(case, selector) as folder:
        scene = DrawnScene.parse(f"fitted:{case.size[1]}x{case.size[0]}").parameters
        splats = {name: scene[name] for name in ("means", "quats", "sh")}
        splats["log_scales"] = np.log(scene["scales"])
        held = np.clip(scene["opacities"], 0.01, 0.99)
        splats["logits"] = np.log(held / (1 - held))
        ways = {
            name: Fitting(folder, rift.open_device(selector, memory=memory), splats)
            for name, memory in (("kept", None), ("streamed", case.memory))
        }
        for fit in ways.values():
            fit.turn(_WARM)
            fit.turns.clear()
        for _ in range(rounds):
            for fit in ways.values():
                fit.turn()
        return {"name": case.name, "ways": {name: fit.record() for name, fit in ways.items()}}


def table(cases: list[dict[str, Any]]) -> Table:
    """A row for each way of each capture."""
    rows = []
    for case in cases:
        for way, fit in case["ways"].items():
            cpu, clock = (min(each) * 1e3 for each in zip(*fit["seconds"], strict=True))
            device, kept = (amount / 1e6 for amount in fit["bytes"])
            rows.append(
                (
                    *(case["name"], way, str(fit["kept"]), f"{cpu:.1f}", f"{clock:.1f}"),
                    *(f"{device:.0f}", f"{kept:.0f}"),
                )
            )
    columns = ("capture", "photographs", "kept", "ms a core", "ms", "device MB", "kept MB")
    notes = (
        "A step's processor time of all threads over the number of cores, and its time on the "
        f"clock, the least of turns of {_STEPS} steps. Memory that the device has from its driver "
        "at the end of a turn, and that of the photographs that are kept.",
    )
    return Table("Photographs", columns, rows, notes, texts=2)


@contextmanager
def _capture(case: PhotographsCase, selector: str) -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        case.write(Path(folder), rift.open_device(selector))
        yield Path(folder)
