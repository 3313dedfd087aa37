"""Does a full disk end every command with a sentence, leave what is whole, and lose nothing?

    python tools/stress_disk.py --tries 400

Runs one command of each kind in peace and counts what it opens, makes and renames in its folder.
Then the disk is full from one of these on, drawn by chance: an audit hook of Python raises ENOSPC,
as a full disk does. What libraries in C write (HDF5, TIFF) is not seen by it; their files meet the
full disk as they are forced to it. The command must end with the status of an output that cannot be
written and one sentence, or with the same bytes as in peace; what it leaves under final names must
be whole; and --resume (--overwrite of `rift export`) must end with the bytes of the run in peace.
Ends with status 1 if one of these does not hold.
"""

from __future__ import annotations

import random
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import tyro

sys.path.insert(0, str(Path(__file__).resolve().parent))

from stress.small_commands import differing, left_in, resumed, short_commands, started

_OUTPUT = 5
# Told its folder, and after how many writes the disk is full; -1: never.
_FULL = """
import errno, os, sys
place, full = os.path.realpath(sys.argv.pop(1)), int(sys.argv.pop(1))
writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT
seen = 0
def hook(event, given):
    global seen
    if event == "open":
        path, mode, flags = given
        if not flags & writes:
            return
    elif event in ("os.mkdir", "os.rename"):
        path = given[0]
    else:
        return
    if not isinstance(path, (str, os.PathLike)) or not os.path.abspath(path).startswith(place):
        return
    seen += 1
    if 0 <= full < seen:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
from rift_cl.commands.cli import main
sys.addaudithook(hook)
status = main()
place = "\\0"
if full < 0:
    print("writes:", seen, file=sys.stderr)
sys.exit(status)
"""


@dataclass(frozen=True)
class Options:
    """Fill the disk under commands, and look at what they say and leave.

    Args:
        tries: how often, dealt to all commands.
        seed: of the places.
        only: commands to try, by a part of their names; all if not given.
    """

    tries: int = 400
    seed: int = 0
    only: str = ""


@dataclass(frozen=True)
class Peace:
    """What a command does when nothing is in its way.

    Args:
        words: the command.
        writes: how often it opens, makes or renames something.
        left: what it leaves.
    """

    words: list[str]
    writes: int
    left: dict[str, bytes]


def main(options: Options) -> int:
    """Run everything, print what was found, and return the exit status."""
    drawn = random.Random(options.seed)
    faults = 0
    with tempfile.TemporaryDirectory(prefix="rift-cl-disk-") as temporary:
        folder = Path(temporary)
        whole = {
            name: _in_peace(words, folder / "peace" / name)
            for name, words in short_commands(folder).items()
            if options.only in name
        }
        names = list(whole)
        for number in range(options.tries):
            name = names[number % len(names)]
            full = drawn.randrange(whole[name].writes)
            fault = _fault(whole[name], folder / str(number) / name, full)
            if fault:
                print(f"try {number} ({name}, full after {full} writes): {fault}", flush=True)
                faults += 1
    print(f"{options.tries} full disks under {len(names)} commands: {faults} faults")
    return int(faults > 0)


def _in_peace(words: list[str], out: Path) -> Peace:
    status, said = _ended(words, out, -1)
    assert status == 0, said
    return Peace(words, int(said[-1].split()[-1]), left_in(out))


def _fault(peace: Peace, out: Path, full: int) -> str:
    """What was wrong with a run on such a disk, and with going on after it; nothing if all held."""
    status, said = _ended(peace.words, out, full)
    if status == 0 and left_in(out) == peace.left:
        return ""
    sentences = [line for line in said if "cannot be written" in line]
    if status != _OUTPUT or "Traceback" in "".join(said) or len(sentences) != 1:
        return f"status {status}: {' / '.join(said[-3:])}"
    broken = [
        name
        for name, content in left_in(out).items()
        if not name.startswith("slabs/") and "runs/" not in name and peace.left.get(name) != content
    ]
    if broken:
        return f"left {broken[0]}"
    process = resumed(peace.words, out)
    _, again = process.communicate()
    other = differing(left_in(out), peace.left)
    if process.returncode or other:
        return f"--resume: status {process.returncode}: {other} {again.strip()[-200:]}"
    return ""


def _ended(words: list[str], out: Path, full: int) -> tuple[int, list[str]]:
    through = ("-c", _FULL, str(out), str(full))
    process = started(words, out, through=through)
    _, said = process.communicate()
    return process.returncode, said.strip().splitlines()


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
