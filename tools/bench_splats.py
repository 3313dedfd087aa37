"""Splats drawn and differentiated, and steps of training: this version beside another one.

    python tools/bench_splats.py --against ../checkout-of-79177a8
    python tools/bench_splats.py --scenes fitted:480x360 cube:1000000:1920x1080 --training
    python tools/bench_splats.py --growth --no-lanes --json growth.json \
        --markdown docs/benchmarks/growth.md --keep docs/benchmarks/splats

Both versions work in one process and take turns, with the same splats and cameras. Times are
processor time of all threads divided by the number of cores, the least of the rounds: what else
the machine does hardly enters. ``raster`` and ``raster gradient`` are the kernels that composite,
alone. A used lane is a pixel in which a listed splat counts, whatever a version evaluates besides.
Memory is the most that the device has from its driver while a scene is drawn and differentiated
three times: splats and pictures, what is kept for later arrays, and what is lost between them.
``--scenes`` understands what ``bench/splat_scenes.py`` says, ``--training`` what
``bench/training_case.py`` says, ``--photographs`` what ``bench/photographs.py`` says: it tells
steps whose photographs are kept from steps whose photographs are read from the disk meanwhile.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import tyro

import rift_cl as rift
from bench import photographs
from bench.checkout import Checkout
from bench.command import report, say
from bench.photographs import PhotographsCase
from bench.splat_scenes import DrawnScene
from bench.surroundings import in_words, surroundings
from bench.table import NONE, Table, markdown_lines
from bench.used_lanes import used_lanes

_SCENES = ("fitted:480x360", "cube:100000:512x512", "needles:20000:512x512")
_TRAINING = ("10000:160x120", "60000:224x168")
_GROWTH = (
    *(
        f"cube:{count}:512x512"
        for count in (10_000, 30_000, 100_000, 300_000, 1_000_000, 2_000_000)
    ),
    *(f"fitted:{size}" for size in ("160x120", "480x360", "960x720", "1920x1080", "3840x2160")),
)
# Steps in a turn of training, and those before anything counts.
_STEPS, _WARM = 8, 8
# Frames while memory is looked at.
_FRAMES = 3
_RASTER = ("raster", "raster gradient")
_WHAT = ("draw", "draw and gradient", *_RASTER)
_OURS = "this version"


@dataclass(frozen=True)
class Options:
    """Measure splats.

    Args:
        scenes: what is drawn, any number.
        training: what is trained on, any number; none to leave training out.
        photographs: captures that are fitted, any number, such as 1000:480x360:128M.
        growth: draw cubes of 10,000 to 2 million splats and the fitted scene up to 4K instead, and
            show a line for each.
        against: checkout of another version.
        rounds: how often each version has its turn.
        lanes: count used lanes, on the host.
        json: file for every figure.
        markdown: file for the tables.
        keep: folder for the result by date, DATE-DEVICE.json.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    scenes: tuple[str, ...] = _SCENES
    training: tuple[str, ...] = _TRAINING
    photographs: tuple[str, ...] = ()
    growth: bool = False
    against: Path | None = None
    rounds: int = 5
    lanes: bool = True
    json: Path | None = None
    markdown: Path | None = None
    keep: Path | None = None
    device: str | None = None


@dataclass
class Version:
    """A version of the package, and how it takes its turn.

    Args:
        name: how tables call it.
        turn: what holds while it works.
        device: its device.
    """

    name: str
    turn: Callable[[], AbstractContextManager[Any]]
    device: Any
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def timed(self, what: str, run: Callable[[], Any]) -> Any:
        """Do something and keep the processor time a core of it."""
        self.device.finish()
        began = time.process_time()
        found = run()
        self.device.finish()
        took = (time.process_time() - began) / (os.cpu_count() or 1)
        self.seconds.setdefault(what, []).append(took)
        return found


class Drawing:
    """A version that draws a scene.

    Args:
        version: which.
        scene: what.
    """

    def __init__(self, version: Version, scene: DrawnScene) -> None:
        self.version = version
        device, splat = version.device, import_module("rift_cl.splat")
        raster = import_module("rift_cl.splat.raster")
        self._rasterize, self._raster_grad = raster.rasterize, raster.raster_grad
        self._splats = splat.Splats.upload(device, **scene.parameters)
        self._camera = import_module("rift_cl.geometry").Camera(*scene.lens)
        self._renderer = renderer = splat.Renderer(device=device)
        # As in training, where the version has a word for it: a frame has one gradient.
        known = signature(renderer.backward).parameters
        self._once = {"retain": False} if "retain" in known else {}
        self._grad = device.array(scene.grad_image)
        self._behind = device.array(np.float32([0.1, 0.2, 0.3]))

    def turn(self) -> Any:
        """Everything once; the frame."""
        timed, renderer = self.version.timed, self._renderer
        frame = timed("draw", self._draw)
        timed("draw and gradient", self._gradient)
        if frame.lists is None:
            return frame
        given: dict[str, Any] = {"settings": renderer.settings, "background": self._behind}
        drawn = self.version.device, _on_screen(frame), frame.lists
        again = timed(_RASTER[0], lambda: self._rasterize(*drawn, self._camera.size, **given))
        timed(_RASTER[1], lambda: self._raster_grad(*drawn, again, self._grad, **given))
        return frame

    def memory(self) -> int:
        """Most bytes that the device has from its driver: ask before anything else is done."""
        device, most = self.version.device, 0
        device.release()
        make = device.empty

        def counted(*given: Any) -> Any:
            nonlocal most
            array = make(*given)
            most = max(most, _taken(device))
            return array

        device.empty = counted
        try:
            for _ in range(_FRAMES):
                self._gradient()
        finally:
            del device.empty
        return most

    def image(self, frame: Any) -> Any:
        """The picture on the host."""
        return self.version.device.get(frame.image)

    def _gradient(self) -> Any:
        return self._renderer.backward(self._draw(), self._grad, **self._once)

    def _draw(self) -> Any:
        return self._renderer.forward(self._splats, self._camera, background=self._behind)


def _taken(device: Any) -> int:
    """Bytes that a device has from its driver; older versions had nothing but a pool."""
    return int(device.taken if hasattr(device, "taken") else device._open().pool.managed_bytes)


def _on_screen(frame: Any) -> Any:
    """What a frame drew; versions differ in where they keep it."""
    for name in ("raster_pass", "drawing", "drawn"):
        if (kept := getattr(frame, name, None)) is not None:
            return kept.screen
    raise AttributeError(f"{type(frame)} keeps no splats of the screen")


def draw(scene: DrawnScene, versions: list[Version], options: Options) -> dict[str, Any]:
    """The record of a scene: times of all versions, and how far their pictures are apart."""
    drawings, memory = [], {}
    for version in versions:
        version.seconds = {}
        with version.turn():
            drawings.append(Drawing(version, scene))
            memory[version.name] = drawings[-1].memory()
    frames: list[Any] = []
    for turn in range(options.rounds + 1):
        if turn == 1:
            for version in versions:
                version.seconds = {}
        frames = []
        for drawing in drawings:
            with drawing.version.turn():
                frames.append(drawing.turn())
    images = [drawing.image(frame) for drawing, frame in zip(drawings, frames, strict=True)]
    record = {
        "name": scene.name,
        "splats": len(scene.parameters["means"]),
        "apart": float(np.linalg.norm(images[0] - images[-1]) / np.linalg.norm(images[-1])),
        "cpu_s": {version.name: version.seconds for version in versions},
        "memory": memory,
    }
    lists = frames[0].lists
    if lists is not None:
        record["entries"] = lists.n_entries
    if options.lanes and lists is not None:
        record["used_lanes"] = used_lanes(versions[0].device, frames[0])
    return record


def train(name: str, versions: list[Version], options: Options) -> dict[str, Any]:
    """The record of a case of training: the time of a step."""
    trainers = []
    for version in versions:
        version.seconds = {}
        with version.turn():
            case = import_module("bench.training_case").TrainingCase.parse(name, version.device)
            trainers.append(case.trainer())
            for _ in range(_WARM):
                trainers[-1].step()
    for _ in range(options.rounds):
        for version, trainer in zip(versions, trainers, strict=True):
            with version.turn():
                version.timed("step", lambda trainer=trainer: _steps(trainer))
    return {"name": name, "cpu_s": {version.name: version.seconds for version in versions}}


def _steps(trainer: Any) -> None:
    for _ in range(_STEPS):
        trainer.step()


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark; all that was measured so far, after each scene."""
    device = rift.open_device(options.device)
    versions = [Version(_OURS, nullcontext, device)]
    if options.against is not None:
        other = Checkout(options.against, bench=True)
        with other.active() as package:
            theirs = package.open_device(device.selector)
        versions.append(Version("the other", other.active, theirs))
    head = {**surroundings(device), "steps": _STEPS, "growth": options.growth}
    drawn, trained, read = (list[dict[str, Any]]() for _ in range(3))
    record = {**head, "scenes": drawn, "training": trained, "photographs": read}
    for text in _GROWTH if options.growth else options.scenes:
        say(text)
        drawn.append(draw(DrawnScene.parse(text), versions, options))
        yield record
    for text in () if options.growth else options.training:
        say(f"training, {text}")
        trained.append(train(text, versions, options))
        yield record
    for text in options.photographs:
        say(f"photographs, {text}")
        read.append(
            photographs.measure(PhotographsCase.parse(text), device.selector, options.rounds)
        )
        yield record


def tables(record: dict[str, Any]) -> Iterator[Table]:
    """A table of the scenes, one of their memory, and one of training; or how scenes grow."""
    if record["growth"]:
        yield _growth_table(record)
        return
    columns = ("scene", "operation", "ms", "other", "times", "ns per used lane", "other")
    notes = (
        "Processor time of all threads over the number of cores, least of the rounds.",
        *(f"{s['name']}: pictures {s['apart']:.1e} apart (L2)" for s in record["scenes"]),
    )
    rows = [row for scene in record["scenes"] for row in _rows(scene, 1)]
    yield Table(record["device"]["name"], columns, rows, notes, texts=2)
    rows = [
        (scene["name"], *_beside([bytes_ / 1e6 for bytes_ in scene["memory"].values()], 0))
        for scene in record["scenes"]
    ]
    yield Table("Memory", ("scene", "MB", "other", "times"), rows, texts=1)
    if record["training"]:
        steps = [row[:5] for case in record["training"] for row in _rows(case, record["steps"])]
        yield Table("Training", columns[:5], steps, texts=2)
    if record["photographs"]:
        yield photographs.table(record["photographs"])


def _growth_table(record: dict[str, Any]) -> Table:
    """What each scene takes of time and memory, this version alone."""
    rows = []
    for scene in record["scenes"]:
        took = scene["cpu_s"][_OURS]
        rows.append(
            (
                scene["name"],
                str(scene["splats"]),
                str(scene.get("entries", NONE)),
                *(f"{1e3 * min(took[what]):.1f}" if what in took else NONE for what in _WHAT),
                f"{scene['memory'][_OURS] / 1e6:.0f}",
            )
        )
    notes = (
        "Milliseconds of processor time of all threads over the number of cores, least of the "
        f"rounds; {record['device']['compute_units']} compute units. Other programs ran on the "
        "same machine; they can only have made a time longer.",
        "Entries: pairs of a splat and a tile that it may touch. MB: the most that the device has "
        "from its driver while the scene is drawn and differentiated, with splats and gradients.",
    )
    columns = ("scene", "splats", "entries", *_WHAT, "MB")
    return Table("Splats drawn and differentiated, as scenes grow", columns, rows, notes)


def page(record: dict[str, Any]) -> str:
    """The tables as a page, with the device named."""
    lines = [
        "<!-- Generated by tools/bench_splats.py; do not edit. -->",
        "# Speed and memory of splats",
        "",
        in_words(record),
        "",
        "`cube` is a cube of small Gaussians of random colours, `fitted` a scene that was fitted "
        "to pictures, drawn at several sizes; both with harmonics of degree 3.",
    ]
    return "\n".join([*lines, *markdown_lines(tables(record))]) + "\n"


def _rows(case: dict[str, Any], parts: int) -> Iterator[tuple[str, ...]]:
    ours, *others = ({k: min(v) / parts for k, v in s.items()} for s in case["cpu_s"].values())
    for what, took in ours.items():
        both = [1e3 * seconds for seconds in (took, *(o[what] for o in others if what in o))]
        lanes = case.get("used_lanes") if what in _RASTER else None
        each = _beside([ms / lanes * 1e6 for ms in both], 3)[:2] if lanes else (NONE, NONE)
        yield (case["name"], what, *_beside(both, 2), *each)


def _beside(both: list[float], digits: int) -> tuple[str, str, str]:
    """Our number, the other's, and how many times ours that is; dashes where there is no other."""
    ours, *others = (f"{number:.{digits}f}" for number in both)
    return ours, *((others[0], f"{both[1] / both[0]:.2f}") if others else (NONE, NONE))


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_splats",
        measure_all(options),
        json_file=options.json,
        markdown_file=options.markdown,
        page=page,
        tables=tables,
        keep_in=options.keep,
        kept=dict,
    )


if __name__ == "__main__":
    sys.exit(main())
