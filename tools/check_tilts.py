"""What tilted detectors cost a reconstruction: the head, tilts known and tilts ignored.

    python tools/check_tilts.py --size 64 --views 90

View by view, detectors are turned about random axes by so many degrees, root mean square about each
of three, and source and detector are shifted by half a sample for each degree; data are exact line
integrals. Prints the PSNR of the volume within the ball that every view sees: by CGLS, and by
filtered backprojection of the same scan with its sources left on their circle.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

import rift_cl as rift
from bench.ball_psnr import ball_psnr


def main() -> None:
    """Print a line for each tilt."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=64, help="edge of the volume in samples")
    parser.add_argument("--views", type=int, default=90, help="number of views")
    parser.add_argument("--steps", type=int, default=12, help="steps of CGLS")
    parser.add_argument("--tilts", type=float, nargs="+", default=[0, 2, 10], help="degrees")
    given = parser.parse_args()
    grid = rift.Grid((given.size,) * 3)
    parts = rift.phantom.head(grid)
    truth = rift.phantom.render(parts, grid)
    plain = gantry(given.size, given.views)
    for degrees in given.tilts:
        for method, solve, scan in (
            ("CGLS", partial(rift.cgls, steps=given.steps), tilted(plain, degrees)),
            ("filtered backprojection", rift.fbp, tilted(plain, degrees, sources=False)),
        ):
            data = rift.phantom.project(parts, grid, scan)
            known = solve(rift.Projector(grid, scan), data)
            line = f"{degrees:g} degrees, {method}: {ball_psnr(known, truth):.2f} dB"
            if degrees:
                ignored = solve(rift.Projector(grid, plain), data)
                line += f", {ball_psnr(ignored, truth):.2f} dB if they are ignored"
            print(line, flush=True)


def gantry(size: int, views: int) -> rift.Vectors:
    """A full turn whose detector just sees the ball in the volume."""
    distance, reach = 3.0 * size, 4.5 * size
    pitch = 1.02 * 2 * reach * np.tan(np.arcsin(0.5 / 3)) / size
    angles = 2 * np.pi * np.arange(views) / views
    return rift.Cone(angles, size, size, pitch, distance, reach).vectors()


def tilted(scan: rift.Vectors, degrees: float, *, sources: bool = True) -> rift.Vectors:
    """The scan with detectors turned and shifted, and its sources too; the same at every call."""
    random = np.random.default_rng(0)
    across, down = scan.across.copy(), scan.down.copy()
    for view, (x, y, z) in enumerate(np.deg2rad(degrees) * random.standard_normal((scan.views, 3))):
        half = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / 2
        turn = np.linalg.solve(np.eye(3) - half, np.eye(3) + half)
        across[view], down[view] = turn @ across[view], turn @ down[view]
    shifts = degrees / 2 * random.standard_normal((2, scan.views, 3))
    source, middle = scan.source + sources * shifts[0], scan.middle + shifts[1]
    return rift.Vectors(source, middle, across, down, scan.rows, scan.bins)


if __name__ == "__main__":
    main()
