"""Is a command that was killed at any moment, and called again with --resume, the same to the byte?

    python tools/stress_resumes.py --kills 100

Runs `rift reconstruct` and `rift render` of a small phantom and a few splats in peace; then each
again in a folder of its own, killed without warning at a moment drawn by chance and then called
with --resume. Ends with status 1 if a resumed run fails, or if what it leaves differs from that of
the run in peace by more than dates and times.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

import rift_cl as rift

# What holds dates and times.
_DATED = ("config.json", "metrics.json", "report.html")


@dataclass(frozen=True)
class Options:
    """Kill commands, resume them, and compare what they leave.

    Args:
        kills: how often, dealt to all commands.
        seed: of the moments.
    """

    kills: int = 100
    seed: int = 0


def main(options: Options) -> int:
    """Run everything, print what was found, and return the exit status."""
    moments = random.Random(options.seed)
    same = cut = 0
    with tempfile.TemporaryDirectory(prefix="rift-cl-resumes-") as folder:
        commands = _commands(Path(folder))
        whole = {}
        for name, words in commands.items():
            begin = time.monotonic()
            assert _started(words, Path(folder, name)).wait() == 0, name
            whole[name] = _left(Path(folder, name)), time.monotonic() - begin
        names = list(commands)
        for number in range(options.kills):
            name = names[number % len(names)]
            wanted, seconds = whole[name]
            out = Path(folder, f"{name}-{number}")
            cut += _killed(commands[name], out, moments.uniform(0.3, 1.0) * seconds)
            status = _started([*commands[name], "--resume"], out).wait()
            alike = status == 0 and _left(out) == wanted
            same += alike
            if not alike:
                print(f"kill {number} ({name}): status {status}, {sorted(_left(out))}")
    print(
        f"{options.kills} runs of {len(names)} commands, {cut} of them killed before their end: "
        f"{same} resumed to the same bytes"
    )
    return int(same < options.kills)


def _commands(folder: Path) -> dict[str, list[str]]:
    """The words of each command, whose input is made in the folder."""
    grid = rift.Grid((96, 96))
    scan = rift.Parallel(np.arange(120) * np.pi / 120, 128)
    slices = np.repeat(rift.phantom.shepp_logan_sinogram(grid, scan)[:, None], 24, axis=1)
    path = folder / "scan.npz"
    np.savez(path, projections=slices, angles=scan.angles)
    drawn = np.random.default_rng(0)
    splats = rift.SplatScene(
        means=drawn.normal(size=(200, 3)),
        log_scales=np.full((200, 3), -2.0),
        quats=np.tile([1.0, 0, 0, 0], (200, 1)),
        logit_opacities=np.full(200, 3.0),
        sh=drawn.normal(size=(200, 1, 3)),
    )
    splats.save(folder / "scene.ply")
    scene = str(folder / "scene.ply")
    return {
        "reconstruct": ["reconstruct", str(path), "--center", "63.5", "--memory", "16M"],
        "render": ["render", scene, "--frames", "12", "--size", "160", "120", "--film", "apng"],
    }


def _started(words: list[str], out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "rift_cl.commands.cli", *words, "--out", str(out), "--quiet"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def _killed(words: list[str], out: Path, seconds: float) -> bool:
    """Run a command for some time at most; whether it was killed."""
    process = _started(words, out)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return True
    return False


def _left(out: Path) -> dict[str, bytes]:
    found = {path.relative_to(out).as_posix(): path for path in out.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if name not in _DATED}


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
