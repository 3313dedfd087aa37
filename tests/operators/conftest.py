"""The scans that every law of the projector is tested on, each with its twins made once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from rift_cl import Device, Projector
from rift_cl.geometry import Grid, Parallel
from rift_cl.reference import MatrixProjector, phase_table, radon

RANDOM = np.random.default_rng(2024)
HALF = np.linspace(0, np.pi, 19, endpoint=False) + 0.011
TIES = [0, np.pi / 4, np.pi / 2, 3 * np.pi / 4, np.pi, -np.pi / 4, -np.pi / 2, 7 * np.pi / 4]

GEOMETRIES: dict[str, tuple[Grid, Parallel]] = {
    "even": (Grid((32, 32)), Parallel(HALF, bins=48)),
    "odd": (Grid((33, 33)), Parallel(HALF, bins=49)),
    "wider than a segment": (Grid((70, 131)), Parallel(HALF, bins=150)),
    "tall": (Grid((131, 70)), Parallel(HALF, bins=150)),
    "full turn": (Grid((24, 31)), Parallel(2 * HALF, bins=41)),
    "irregular and unsorted": (Grid((31, 24)), Parallel(RANDOM.uniform(-9, 9, 23), bins=40)),
    "one angle": (Grid((30, 21)), Parallel([0.3], bins=37)),
    "angles where the walk changes": (Grid((21, 34)), Parallel(TIES, bins=44)),
    "a hair beside those": (Grid((21, 34)), Parallel(np.add(TIES, 1e-9), bins=44)),
    "only walked along y": (Grid((17, 20)), Parallel(np.pi / 2 + HALF / 9, bins=30)),
    "single pixel": (Grid((1, 1)), Parallel(HALF, bins=5)),
    "single row": (Grid((1, 75)), Parallel(HALF, bins=80)),
    "single column": (Grid((75, 1)), Parallel(HALF, bins=80)),
    "single bin": (Grid((20, 30)), Parallel(HALF, bins=1)),
    "off-centre axis": (Grid((28, 29)), Parallel(HALF, bins=45, center=13.37)),
    "off-centre grid": (Grid((28, 29), center=(-7.2, 11.9)), Parallel(HALF, bins=61)),
    "partly outside": (Grid((40, 40)), Parallel(HALF, bins=20, center=2.5)),
    "misses the object": (Grid((20, 20), center=(400, 400)), Parallel([0.1, 0.7, 1.4], bins=32)),
    "coarse spacing": (Grid((25, 30), spacing=7.3), Parallel(HALF, bins=44, pitch=7.3)),
    "fine spacing": (Grid((25, 30), spacing=0.01), Parallel(HALF, bins=44, pitch=0.01)),
    "anisotropic": (Grid((40, 23), spacing=(0.5, 1.7)), Parallel(HALF, bins=60, pitch=0.8)),
    "very anisotropic": (Grid((9, 40), spacing=(50, 1)), Parallel(HALF, bins=60, pitch=6.0)),
    "narrow bins": (Grid((24, 25)), Parallel(HALF, bins=700, pitch=0.05)),
    "bins of a quarter": (Grid((24, 25)), Parallel([*HALF, *TIES], bins=150, pitch=0.25)),
    "wide bins": (Grid((50, 44)), Parallel(HALF, bins=7, pitch=13.0)),
    "very wide bins": (Grid((50, 44)), Parallel(HALF, bins=3, pitch=900.0)),
    "one slice": (Grid((1, 20, 25)), Parallel(HALF, bins=34)),
    "stack": (Grid((5, 33, 20), spacing=(3, 1, 1)), Parallel(HALF, bins=40)),
    "stack of more than a slab": (Grid((17, 14, 11)), Parallel(HALF, bins=19)),
    "stack of more than two": (Grid((33, 9, 12)), Parallel(HALF, bins=16)),
}


# Those that differ for the other footprints: what is wide or narrow, cut off or aslant.
FOOTPRINTED = (
    "odd",
    "wider than a segment",
    "full turn",
    "angles where the walk changes",
    "a hair beside those",
    "single pixel",
    "single row",
    "off-centre axis",
    "off-centre grid",
    "partly outside",
    "anisotropic",
    "very anisotropic",
    "narrow bins",
    "bins of a quarter",
    "wide bins",
    "stack",
)


class Geometry(NamedTuple):
    """A grid, a scan and a footprint, with the projector's twin and what it approximates."""

    grid: Grid
    scan: Parallel
    footprint: str
    twin: MatrixProjector
    exact: MatrixProjector

    def projector(self, device: Device, **settings: Any) -> Projector:
        """The projector itself."""
        return Projector(self.grid, self.scan, self.footprint, device=device, **settings)

    def white(self, seed: int) -> tuple[Any, Any]:
        """A white image and a white sinogram."""
        random = np.random.default_rng(seed)
        rows = self.grid.shape[:-2]
        image = random.standard_normal(self.grid.shape)
        sinogram = random.standard_normal((len(self.scan.angles), *rows, self.scan.bins))
        return image.astype(np.float32), sinogram.astype(np.float32)


def _geometry(name: str, footprint: str = "strip") -> Geometry:
    grid, scan = GEOMETRIES[name]
    pair = phase_table(grid, scan, footprint), radon(grid, scan, footprint)
    return Geometry(grid, scan, footprint, *pair)


@pytest.fixture(
    scope="session",
    params=[(name, "strip") for name in GEOMETRIES]
    + [(name, footprint) for name in FOOTPRINTED for footprint in ("joseph", "linear")],
    ids="-".join,
)
def geometry(request: pytest.FixtureRequest) -> Geometry:
    return _geometry(*request.param)


@pytest.fixture(
    scope="session", params=[n for n, (g, _) in GEOMETRIES.items() if len(g.shape) == 3]
)
def stack(request: pytest.FixtureRequest) -> Geometry:
    return _geometry(request.param)
