"""What reading files in a child process costs: its start, and its pipe.

    python tools/decoder_price.py

Starts a child for each library that decodes files. Reads a JPEG of 12 megapixels as the package
does, in its child, and in this process. Sends a slab of a scan through a pipe, which the package
does not do, and reads it from HDF5 in this process, which it does. All of it in seconds of the
clock, the least of some rounds.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from rift_cl.io import read_image
from rift_cl.io.images.pixels import decode_pixels, write_pixels

_LIBRARIES = ("pi_heif", "OpenImageIO", "h5py", "imagecodecs", "av")
_SENDER = "import sys; sys.stdout.buffer.write(bytes(int(sys.argv[1])))"
_ROUNDS = 5


def main() -> None:
    """Print a line for each price."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    for name in _LIBRARIES:
        print(f"start of a child with NumPy and {name}: {_least(partial(_start, name)):.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        picture, scan = Path(folder, "a.jpg"), Path(folder, "a.h5")
        blocks = np.random.default_rng(0).random((375, 500, 3), np.float32)
        write_pixels(picture, blocks.repeat(8, 0).repeat(8, 1), format="jpeg", attributes={})
        child = _least(partial(read_image, picture, budget=1 << 30))
        here = _least(partial(decode_pixels, picture, "jpeg", 1 << 30))
        print(f"a JPEG of 12 megapixels: {child:.2f} s by the child, {here:.2f} s in this process")
        slab = np.random.default_rng(0).random((64, 1024, 1024), np.float32)
        with h5py.File(scan, "w") as file:
            file["data"] = slab
        pipe = _least(partial(_sent, slab.nbytes)) - _least(partial(_sent, 0))
        here = _least(partial(_read, scan))
        print(
            f"256 MiB of an HDF5 file: {pipe:.2f} s by a pipe alone, {here:.2f} s in this process"
        )


def _least(do: Callable[[], object]) -> float:
    """Seconds that it takes at least."""
    found = []
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        do()
        found.append(time.perf_counter() - begin)
    return min(found)


def _start(library: str) -> None:
    subprocess.run([sys.executable, "-c", f"import numpy, {library}"], check=True)


def _sent(size: int) -> None:
    """An array of so many bytes, from a child."""
    subprocess.run([sys.executable, "-c", _SENDER, str(size)], stdout=subprocess.PIPE, check=True)


def _read(path: Path) -> None:
    with h5py.File(path) as file:
        file["data"][...]


if __name__ == "__main__":
    main()
