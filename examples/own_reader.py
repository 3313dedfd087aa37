"""A reader of your own: files that no other program knows become scans.

``rift.register_scan_reader`` takes an extension and a function from a path to a scan, and from then
on ``rift.open_scan``, ``rift.reconstruct_scan``, ``rift.fit`` and the command line in this process
read such files. A memory map keeps a scan on the disk until its rows are wanted. Run it, or give it
to ``rift --load``.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

import rift_cl as rift


def open_raw(path, request):
    """Samples of float32 in ``scan.raw``, and what they are in ``scan.json`` beside it."""
    header = json.loads(path.with_suffix(".json").read_text())
    values = np.memmap(path, np.float32, mode="r", shape=tuple(header["shape"]))
    angles = np.radians(header["degrees"])
    return rift.scan_of_arrays(path, values, angles, pitch=header["pitch_mm"], unit="mm")


rift.register_scan_reader(".raw", open_raw)


def main():
    """Write such a scan and reconstruct it."""
    with tempfile.TemporaryDirectory() as folder:
        grid, degrees = rift.Grid((4, 64, 64), spacing=0.5), np.arange(0, 180, 2.0)
        scan = rift.Parallel(np.radians(degrees), bins=96, pitch=0.5)
        sinograms = rift.phantom.shepp_logan_sinogram(grid, scan).astype(np.float32)
        sinograms.tofile(Path(folder, "scan.raw"))
        header = {"shape": sinograms.shape, "degrees": degrees.tolist(), "pitch_mm": 0.5}
        Path(folder, "scan.json").write_text(json.dumps(header))

        made = rift.reconstruct_scan(Path(folder, "scan.raw"), filter="hann")
        print(made)
        print("\n".join(made.notes))
        print(f"{made.read().shape} voxels, the axis at bin {made.settings.center:.2f}")


if __name__ == "__main__":
    main()
