"""Is a fit that was killed again and again the same fit, to the bit?

    python tools/stress_kills.py CAPTURE --kills 30

Runs one fit in peace; then the same fit, killed without warning at moments drawn by chance and
taken up again with --resume until it is through. Most kills fall between two checkpoints; with a
checkpoint every few steps a good share falls while one is being written. After every kill all
checkpoints that have got their names must be whole. Ends with status 1 if the two scenes differ, or
a checkpoint was damaged.
"""

from __future__ import annotations

import hashlib
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional

from rift_cl.errors import CheckpointError
from rift_cl.io.checkpoint import load_checkpoint


@dataclass(frozen=True)
class Options:
    """Kill a fit many times and compare what comes of it.

    Args:
        capture: what is fitted.
        kills: how often.
        steps: of the fit.
        splats: most splats.
        every: steps between two checkpoints.
        longest: seconds after which a fit is killed at the latest, counted from its first sign.
        seed: of the moments.
    """

    capture: Annotated[Path, Positional]
    kills: int = 30
    steps: int = 600
    splats: int = 2000
    every: int = 25
    longest: float = 2.0
    seed: int = 0


def main(options: Options) -> int:
    """Run both fits, print what was found, and return the exit status."""
    with tempfile.TemporaryDirectory(prefix="rift-cl-kills-") as folder:
        whole, cut = Path(folder, "whole"), Path(folder, "cut")
        _started(options, whole).wait()
        moments = random.Random(options.seed)
        kills, damaged, writing = 0, 0, 0
        while kills < options.kills:
            if not _killed(options, cut, moments.uniform(0, options.longest)):
                print(f"the fit was through after {kills} kills: give it more --steps")
                break
            kills += 1
            damaged += sum(not _is_whole(path) for path in _checkpoints(cut))
            writing += len(list((cut / "checkpoints").glob("*.part")))
        _started(options, cut).wait()
        same = _digest(whole) == _digest(cut)
    print(
        f"{kills} kills, {writing} of them while a checkpoint was being written; "
        f"{damaged} damaged checkpoints; the scene is {'the same' if same else 'NOT the same'}"
    )
    return 0 if same and not damaged and kills == options.kills else 1


def _started(options: Options, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "rift_cl.commands.cli", "fit", str(options.capture)]
    command += ["--out", str(out), "--steps", str(options.steps), "--splats", str(options.splats)]
    command += ["--checkpoint-every", str(options.every), "--resume", "--quiet"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def _killed(options: Options, out: Path, seconds: float) -> bool:
    """Run until some time after the fit went on, and kill it; False if it was through before."""
    before = {path.name for path in _checkpoints(out)}
    process = _started(options, out)
    while process.poll() is None and {path.name for path in _checkpoints(out)} == before:
        time.sleep(0.005)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return True
    return False


def _checkpoints(out: Path) -> list[Path]:
    return sorted((out / "checkpoints").glob("step-*.npz"))


def _is_whole(path: Path) -> bool:
    try:
        load_checkpoint(path)
    except CheckpointError as error:
        print(error)
        return False
    return True


def _digest(out: Path) -> str:
    return hashlib.sha256((out / "scene.ply").read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
