"""What reading files in a child process would cost, in processor time: its start, and its pipe.

    python tools/decoder_price.py

Starts a child for each library that decodes files, sends arrays of the sizes of a picture of 12
megapixels and of a slab of a scan through a pipe as ``rift_cl.cl.build.worker`` sends binaries,
and reads the same arrays in this process.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from rift_cl.io import read_image
from rift_cl.io.images.pixels import write_pixels

_LIBRARIES = ("pi_heif", "OpenImageIO", "h5py", "imagecodecs", "av")
_SENDER = "import sys; sys.stdout.buffer.write(bytes(int(sys.argv[1])))"
_MIB, _ROUNDS = 1 << 20, 5


def main() -> None:
    """Print a line for each price, the least of some rounds."""
    for name in _LIBRARIES:
        print(f"start of a child with NumPy and {name}: {_least(partial(_start, name)):.2f} s")
    begun = _least(partial(_sent, 0))
    with tempfile.TemporaryDirectory() as folder:
        picture, scan = Path(folder, "a.jpg"), Path(folder, "a.h5")
        blocks = np.random.default_rng(0).random((375, 500, 3), np.float32)
        write_pixels(picture, blocks.repeat(8, 0).repeat(8, 1), format="jpeg", attributes={})
        slab = np.random.default_rng(0).random((64, 1024, 1024), np.float32)
        with h5py.File(scan, "w") as file:
            file["data"] = slab
        prices = (
            ("a JPEG of 12 megapixels", 36_000_000, partial(read_image, picture, budget=1 << 30)),
            ("256 MiB of an HDF5 file", slab.nbytes, partial(_read, scan)),
        )
        for what, size, read in prices:
            pipe = _least(partial(_sent, size)) - begun
            print(
                f"{what}: read in {_least(read):.2f} s; {size / _MIB:.0f} MiB by pipe {pipe:.2f} s"
            )


def _least(do: Callable[[], object]) -> float:
    """Seconds of processor time that it takes at least, here and in children."""

    def taken() -> float:
        return sum(os.times()[:4])

    found = []
    for _ in range(_ROUNDS):
        begin = taken()
        do()
        found.append(taken() - begin)
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
