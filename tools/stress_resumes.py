"""Is a command that was killed at any moment, and called again with --resume, the same to the byte?

    python tools/stress_resumes.py --kills 100

Runs one command of each kind, of a small phantom, a few splats and four photographs, in peace; then
each again in a folder of its own, killed without warning at a moment drawn by chance and then
called with --resume (`rift export`, which writes one file, with --overwrite). Ends with status 1 if
a resumed run fails, or if what it leaves differs from that of the run in peace by more than dates
and times.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import tyro

sys.path.insert(0, str(Path(__file__).resolve().parent))

from stress.small_commands import differing, left_in, long_commands, resumed, started


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
        commands = long_commands(Path(folder))
        whole = {}
        for name, words in commands.items():
            begin = time.monotonic()
            out = Path(folder, "peace", name)
            assert _waited(started(words, out)) == 0, name
            whole[name] = left_in(out), time.monotonic() - begin
        names = list(commands)
        for number in range(options.kills):
            name = names[number % len(names)]
            wanted, seconds = whole[name]
            out = Path(folder, str(number), name)
            cut += _killed(commands[name], out, moments.uniform(0.3, 1.0) * seconds)
            status = _waited(resumed(commands[name], out))
            other = differing(left_in(out), wanted)
            alike = status == 0 and not other
            same += alike
            if not alike:
                print(f"kill {number} ({name}): status {status}, differing: {other}", flush=True)
    print(
        f"{options.kills} runs of {len(names)} commands, {cut} of them killed before their end: "
        f"{same} resumed to the same bytes"
    )
    return int(same < options.kills)


def _waited(process: subprocess.Popen[str]) -> int:
    _, said = process.communicate()
    print(said, end="", file=sys.stderr)
    return process.returncode


def _killed(words: list[str], out: Path, seconds: float) -> bool:
    """Run a command for some time at most; whether it was killed."""
    process = started(words, out)
    try:
        process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return True
    return False


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
