"""What a wedge of 30 degrees still tells of a disc with holes, without a trained prior.

    python tools/limited_angle.py --out limited
    python tools/limited_angle.py --data htc2022 --out limited

The first form looks at phantoms of its own: discs with round holes, with cells between struts, and
with irregular openings, seen by a fan beam over 30 degrees, with a hardened beam, an offset and
noise. All settings were chosen on these. The second form adds scans of the Helsinki Tomography
Challenge 2022 (NAME.mat beside NAME_truth.png), on which nothing was chosen. The score is the
challenge's: the Matthews correlation of the segmentation with the truth, 1 for a perfect one.

Each row of the table adds one thing that is known: the lengths of material along rays (from the
disc's rim, see ``disc_prior``), that no value exceeds the material's, that nothing lies outside the
disc, which edges the views do not see, that there are two levels.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray
from scipy import ndimage

import rift_cl as rift
from rift_cl.commands.console_table import print_table
from rift_cl.geometry import FanBeam
from rift_cl.io import open_scan, read_image, write_png
from rift_cl.reconstruct import (
    DirectionWeights,
    FewLevels,
    Pdhg,
    find_disc,
    material_lengths,
    rebin_fan,
)
from rift_cl.reconstruct.direct.fan_rebin import covered_rays

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# The challenge's scanner, in millimetres, and the grid of its truth.
_FAN, _BINS = FanBeam(410.66, 553.74, 0.2, 279.5), 560
_TRUTH, _PIXEL = 512, 0.14832
# A beam of two energies that hardens as acrylic does, an offset and a noise like the scanner's.
_SHARES, _ATTENUATION, _OFFSET, _NOISE = (0.6, 0.4), (0.026, 0.066), 0.0147, 0.0042
# Weights of the plain total variation, of which the best is a row of its own.
_PLAIN_WEIGHTS = (0.02, 0.05, 0.1, 0.2, 0.5)
# Chosen on phantoms, for lengths in millimetres and levels of 0 and 1.
_WEIGHT = 1.0


@dataclass(frozen=True)
class Options:
    """Score reconstructions from a wedge of 30 degrees.

    Args:
        out: folder for the pictures.
        data: folder with NAME.mat and NAME_truth.png; phantoms alone if not given.
        seeds: of the phantoms; none to leave them out.
        size: pixels along an edge of a reconstruction.
        steps: of every method, twice as many where a pull sets in later.
    """

    out: Path
    data: Path | None = None
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    size: int = 256
    steps: int = 600


@dataclass(frozen=True)
class Scan:
    """One limited-angle scan with its truth.

    Args:
        name: for the table.
        sinogram: line integrals of parallel rays, (angle, bin).
        seen: which of them were measured.
        geometry: of the rays.
        truth: where there is material, rows upwards.
    """

    name: str
    sinogram: Floats
    seen: Mask
    geometry: rift.Parallel
    truth: Mask


def measured(folder: Path) -> Iterator[Scan]:
    """The challenge's scans in a folder."""
    for path in sorted(folder.glob("*.mat")):
        file = open_scan(path)
        if file.fan is None:
            raise rift.RiftError(
                f"{path}: a parallel scan, wanted one of the challenge's fan scans"
            )
        stack = file.read(0, 1).projections
        sinogram, geometry = rebin_fan(stack[:, 0], file.angles, file.fan, whole=False)
        _, seen = covered_rays(file.angles, stack.shape[-1], file.fan, whole=False)
        truth = read_image(path.with_name(f"{path.stem}_truth.png"))[::-1] > 0.5
        yield Scan(path.stem, sinogram, seen, geometry, truth)


def simulated(seed: int) -> Scan:
    """A phantom's scan, with more pixels than any reconstruction has."""
    random = np.random.default_rng(1000 + seed)
    turn = random.uniform(0, np.pi)
    geometry, seen = covered_rays(np.deg2rad(np.arange(61) * 0.5) + turn, _BINS, _FAN, whole=False)
    kind = ("holes", "struts", "openings")[seed % 3]
    truth = phantom(kind, np.random.default_rng(seed))
    A = rift.Projector(rift.Grid(truth.shape, _PIXEL), geometry, "strip")
    length = A(truth.astype(np.float32)).astype(float)
    share = sum(s * np.exp(-mu * length) for s, mu in zip(_SHARES, _ATTENUATION, strict=True))
    noisy = -np.log(share) + _OFFSET + _NOISE * random.standard_normal(length.shape)
    sinogram = np.where(seen, noisy, 0).astype(np.float32)
    return Scan(f"{kind} {seed}", sinogram, seen, geometry, truth)


def phantom(kind: str, random: np.random.Generator) -> Mask:
    """A disc of about 35 mm radius with holes of some kind, (512, 512)."""
    y, x = (np.mgrid[:_TRUTH, :_TRUTH] - (_TRUTH - 1) / 2) * _PIXEL
    middle, radius = random.uniform(-1.5, 1.5, 2), random.uniform(33.5, 35.5)
    x, y = x - middle[0], y - middle[1]
    depth = radius - np.hypot(x, y)
    # Shapes are bent a little, so that no edge is a straight line or an ellipse.
    x, y = x + _smooth(random, 60) * 0.7, y + _smooth(random, 60) * 0.7
    holes = {"holes": _round_holes, "struts": _cells, "openings": _openings}[kind]
    return np.asarray((depth > 0) & ~holes(x, y, depth, random))


def _smooth(random: np.random.Generator, width: float) -> NDArray[np.float64]:
    field = ndimage.gaussian_filter(random.standard_normal((_TRUTH, _TRUTH)), width)
    return np.asarray(field / field.std())


def _round_holes(x: Any, y: Any, depth: Any, random: np.random.Generator) -> Mask:
    holes = np.zeros(x.shape, bool)
    taken: list[tuple[NDArray[np.float64], float]] = []
    wanted, radius = random.integers(4, 12), depth.max()
    for _ in range(400):
        place, axes = random.uniform(-radius, radius, 2), random.uniform(3, 8, 2)
        reach = axes.max()
        crowded = any(np.hypot(*(place - other)) < reach + size + 2.5 for other, size in taken)
        if np.hypot(*place) + reach > radius - 3 or crowded:
            continue
        taken.append((place, reach))
        turn, power = random.uniform(0, np.pi), random.uniform(2, 4)
        along = (x - place[0]) * np.cos(turn) + (y - place[1]) * np.sin(turn)
        across = (y - place[1]) * np.cos(turn) - (x - place[0]) * np.sin(turn)
        holes |= np.abs(along / axes[0]) ** power + np.abs(across / axes[1]) ** power < 1
        if len(taken) >= wanted:
            break
    return holes


def _cells(x: Any, y: Any, depth: Any, random: np.random.Generator) -> Mask:
    centres: list[NDArray[np.float64]] = []
    wanted, radius = random.integers(8, 18), depth.max()
    for _ in range(2000):
        place = random.uniform(-radius, radius, 2)
        apart = all(np.hypot(*(place - other)) > 9 for other in centres)
        if np.hypot(*place) < 0.85 * radius and apart and len(centres) < wanted:
            centres.append(place)
    away = np.sort(np.stack([np.hypot(x - p[0], y - p[1]) for p in centres]), axis=0)
    inside = (away[1] - away[0] > random.uniform(2, 5)) & (depth > random.uniform(3.5, 7))
    return np.asarray(ndimage.gaussian_filter(inside.astype(float), 8) > 0.5)


def _openings(x: Any, y: Any, depth: Any, random: np.random.Generator) -> Mask:
    field = _smooth(random, random.uniform(18, 32))
    inside = (field > random.uniform(0.6, 1)) & (depth > random.uniform(3.5, 5))
    return np.asarray(ndimage.gaussian_filter(inside.astype(float), 4) > 0.5)


def methods(options: Options) -> dict[str, Callable[[Scan], Floats]]:
    """Every method by its name: from a scan to an image."""

    def projector(scan: Scan) -> rift.Projector:
        spacing = _PIXEL * _TRUTH / options.size
        grid = rift.Grid((options.size, options.size), spacing)
        return rift.Projector(grid, scan.geometry, "strip")

    def run(solver: Any, steps: int = options.steps) -> Floats:
        for _ in solver.run(steps):
            pass
        return np.asarray(solver.data.device.get(solver.image))

    def plain(scan: Scan, weight: float) -> Floats:
        A = projector(scan)
        return run(Pdhg(A, scan.sinogram, weight, nonnegative=True, weights=scan.seen))

    def best(scan: Scan) -> Floats:
        images = [plain(scan, weight) for weight in _PLAIN_WEIGHTS]
        return max(images, key=lambda image: score(image, otsu(image), scan.truth))

    def levels(scan: Scan, known: str) -> Floats:
        A = projector(scan)
        disc = find_disc(scan.sinogram, scan.geometry, seen=scan.seen)
        lengths = material_lengths(scan.sinogram, scan.geometry, disc, seen=scan.seen).lengths
        if known == "lengths":
            return run(Pdhg(A, lengths, _WEIGHT, nonnegative=True, weights=scan.seen))
        given: dict[str, Any] = {"weights": scan.seen}
        if known != "pull":
            given["pull"] = 0.0
        if known != "bounds":
            given["support"] = disc.coverage(A.grid)
        if known in ("directions", "pull"):
            given["direction_weights"] = DirectionWeights.of(scan.geometry.angles)
        if known == "pull":
            return run(FewLevels(A, lengths, _WEIGHT, **given), 2 * options.steps)
        return run(FewLevels(A, lengths, _WEIGHT, **given))

    return {
        "plain TV, weight 0.2": lambda scan: plain(scan, 0.2),
        "plain TV, its best weight": best,
        "path lengths in material": lambda scan: levels(scan, "lengths"),
        "+ bounds 0 and 1": lambda scan: levels(scan, "bounds"),
        "+ zero outside the disc": lambda scan: levels(scan, "disc"),
        "+ direction weights": lambda scan: levels(scan, "directions"),
        "+ attraction to the levels": lambda scan: levels(scan, "pull"),
    }


def otsu(image: Floats) -> float:
    """The threshold that parts an image into two classes with the least variance (Otsu 1979)."""
    counts, edges = np.histogram(image, 256)
    middles = (edges[1:] + edges[:-1]) / 2
    below, sums = np.cumsum(counts), np.cumsum(counts * middles)
    above = below[-1] - below
    with np.errstate(all="ignore"):
        between = below * above * (sums / below - (sums[-1] - sums) / above) ** 2
    return float(edges[1:][np.nanargmax(between)])


def score(image: Floats, threshold: float, truth: Mask) -> float:
    """The Matthews correlation of an image's segmentation, on the truth's pixels.

    A segmentation of one class alone scores 0.
    """
    fine = ndimage.zoom(image, truth.shape[0] / len(image), order=1, grid_mode=True, mode="nearest")
    found = fine > threshold
    if found.all() or not found.any():
        return 0.0
    return float(np.corrcoef(found.ravel(), truth.ravel())[0, 1])


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    options.out.mkdir(parents=True, exist_ok=True)
    groups = {"phantoms": [simulated(seed) for seed in options.seeds]}
    if options.data is not None:
        groups["challenge"] = list(measured(options.data))
    for scans in filter(None, groups.values()):
        rows = []
        for number, (name, method) in enumerate(methods(options).items()):
            images = [method(scan) for scan in scans]
            # Where the levels are known the threshold is their middle, else it is Otsu's.
            scores = [
                score(image, 0.5 if "+" in name else otsu(image), scan.truth)
                for image, scan in zip(images, scans, strict=True)
            ]
            rows.append([name, *(f"{s:.3f}" for s in scores), f"{np.mean(scores):.3f}"])
            for image, scan in zip(images, scans, strict=True):
                _picture(options.out / f"{scan.name.replace(' ', '_')}_{number}.png", image)
        print_table(
            ["what is known", *(scan.name for scan in scans), "mean"],
            rows,
            caption="Matthews correlation; struts run across the rays that no view sees",
        )
        for scan in scans:
            _picture(options.out / f"{scan.name.replace(' ', '_')}_truth.png", scan.truth)
    return 0


def _picture(path: Path, image: NDArray[Any]) -> None:
    shown = image.astype(float)[::-1]
    write_png(path, np.clip(shown / max(float(np.percentile(shown, 99.5)), 1e-9), 0, 1))


if __name__ == "__main__":
    sys.exit(main())
