"""The stripe filters against those of algotom, on real sinograms: differences and what is left.

    python tools/compare_stripes.py --tooth tooth.h5 --dendrites RealDataDend.mat --out stripes

Each method is run beside algotom's of the same paper on the same line integrals, with algotom's
defaults but for windows, which are ours. Where algotom takes ratios (`fitting`, `large`, `vo`) it
is given transmissions exp(-p), of line integrals p brought to a range of 2, and the logarithm of
its result is compared: ratios of line integrals mean nothing in air.

The table gives shares of the sinogram's range: the root mean square and the largest difference
between the two results, how much each method changed, and the stripes that each left (the root
mean square over bins of the mean along the views less its median over 21 bins). The folder gets a
picture of every sinogram and slice. `dead` is given the sinogram with three dead bins and two that
fluctuate. With --time, both are timed in turns (1500 views x 1024 bins).

algotom is needed: pip install algotom.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

import rift_cl as rift
from rift_cl.io import open_scan
from rift_cl.reconstruct import find_center, remove_rings

Floats = NDArray[Any]
# Bins of the median in both.
_WINDOW = 21
_BY_RATIOS = ("fitting", "large", "vo")
_ROWS, _ROUNDS = 4, 4


@dataclass(frozen=True)
class Options:
    """Compare stripe filters.

    Args:
        tooth: HDF5 (Data Exchange) with flats and darks; its first row is taken.
        dendrites: MAT file with a sinogram.
        out: folder for the pictures; none are made if not given.
        time: also measure processor seconds.
    """

    tooth: Path | None = None
    dendrites: Path | None = None
    out: Path | None = None
    time: bool = False


def main(options: Options) -> None:
    """Print the table, and draw the pictures."""
    for name, path in (("tooth", options.tooth), ("dendrites", options.dendrites)):
        if path is None:
            continue
        sinogram, angles = _read(path)
        print(f"\n{name}: {sinogram.shape[0]} views, {sinogram.shape[1]} bins; ", end="")
        print(f"stripes before {_stripes(sinogram):.2e}")
        print(
            "| method | rms difference | largest | changed by us, algotom | left by us, algotom |"
        )
        print("| :-- | --: | --: | --: | --: |")
        results = {"before": sinogram}
        for method, before, ours, theirs in _results(sinogram):
            results |= {method: ours, f"{method} (algotom)": theirs}
            print(_line(method, before, ours, theirs))
        if options.out is not None:
            _draw(options.out / name, results, angles)
    if options.time:
        _time()


def _time() -> None:
    """Processor seconds of all methods, each in turns with algotom's."""
    random = np.random.default_rng(0)
    shape = (1500, _ROWS, 1024)
    waves = np.sin(np.linspace(0, 3, shape[2])) * (1 + np.sin(np.linspace(0, 3, shape[0])))[:, None]
    stack = waves[:, None] + random.normal(0, 0.02, shape) + random.normal(0, 0.01, shape[1:])
    stack = stack.astype(np.float32)
    print(f"\nprocessor seconds a sinogram of {shape[0]} x {shape[2]}, on {rift.default_device()}")
    print("| method | ours | algotom | times |")
    print("| :-- | --: | --: | --: |")
    for method, peer in _peers().items():
        ours, theirs = [], []
        for _ in range(_ROUNDS):
            start = time.process_time()
            remove_rings(stack, method=method)
            ours.append((time.process_time() - start) / _ROWS)
            start = time.process_time()
            peer(stack[:, 0])
            theirs.append(time.process_time() - start)
        # The first round builds kernels.
        mine, other = np.median(ours[1:]), np.median(theirs[1:])
        print(f"| `{method}` | {mine:.3f} | {other:.3f} | {other / mine:.1f} |")


def _peers() -> dict[str, Callable[[Floats], Floats]]:
    """The function of algotom for each of our methods."""
    from algotom.prep import removal as peer

    return {
        "sorting": lambda y: peer.remove_stripe_based_sorting(y, _WINDOW),
        "filtering": lambda y: peer.remove_stripe_based_filtering(y, 3, _WINDOW),
        "fitting": peer.remove_stripe_based_fitting,
        "large": peer.remove_large_stripe,
        "dead": lambda y: peer.remove_dead_stripe(y, residual=False),
        "vo": peer.remove_all_stripe,
        "wavelet-fft": peer.remove_stripe_based_wavelet_fft,
    }


def _results(sinogram: Floats) -> Iterator[tuple[str, Floats, Floats, Floats]]:
    """Method, what it was given, our result, algotom's."""
    scale = np.ptp(sinogram) / 2
    for method, peer in _peers().items():
        before = _with_dead_bins(sinogram) if method == "dead" else sinogram
        windowed = method in ("sorting", "filtering", "vo")
        ours = remove_rings(before, method=method, **({"window": _WINDOW} if windowed else {}))
        if method in _BY_RATIOS:
            cleaned = peer(np.exp(-before / scale))
            yield method, before, ours, np.asarray(-np.log(np.maximum(cleaned, 1e-7)) * scale)
        else:
            yield method, before, ours, peer(before)


def _with_dead_bins(sinogram: Floats) -> Floats:
    """A sinogram in which three bins answer to nothing, and two jump from view to view."""
    random, damaged = np.random.default_rng(2), sinogram.copy()
    bins = (np.array([0.31, 0.45, 0.58, 0.38, 0.52]) * sinogram.shape[1]).astype(int)
    damaged[:, bins[:3]] = 0.5 * sinogram.max()
    damaged[:, bins[3:]] += random.normal(0, 0.2 * np.ptp(sinogram), (len(sinogram), 2))
    return damaged


def _line(method: str, before: Floats, ours: Floats, theirs: Floats) -> str:
    scale = np.ptp(before)
    difference = (ours - theirs) / scale
    changed = [_rms((after - before) / scale) for after in (ours, theirs)]
    left = [_stripes(after, scale) for after in (ours, theirs)]
    return (
        f"| `{method}` | {_rms(difference):.2e} | {np.abs(difference).max():.2e} "
        f"| {changed[0]:.2e}, {changed[1]:.2e} | {left[0]:.2e}, {left[1]:.2e} |"
    )


def _stripes(sinogram: Floats, scale: float | None = None) -> float:
    """What the mean along the views has that its median across bins has not."""
    from scipy.ndimage import median_filter

    level = sinogram.mean(axis=0, dtype=np.float64)
    away = level - median_filter(level, _WINDOW, mode="reflect")
    return _rms(away) / float(np.ptp(sinogram) if scale is None else scale)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


def _read(path: Path) -> tuple[Floats, Floats]:
    """Line integrals of one row, zero outside the object, and the angles."""
    from rift_cl.commands.inputs.scan_rows import read_attenuation

    scan = open_scan(path)
    sinogram = read_attenuation(scan, 0, 1).projections[:, 0]
    edges = np.concatenate([sinogram[:, :8], sinogram[:, -8:]], axis=1)
    return np.ascontiguousarray(sinogram - edges.mean(), np.float32), scan.angles


def _draw(folder: Path, results: dict[str, Floats], angles: Floats) -> None:
    from skimage.io import imsave

    folder.mkdir(parents=True, exist_ok=True)
    before = results["before"]
    center = find_center(before, angles).center
    A = rift.Projector(
        rift.Grid((before.shape[1],) * 2), rift.Parallel(angles, before.shape[1], center=center)
    )
    spans = [np.percentile(image, (0.5, 99.5)) for image in (before, rift.fbp(A, before))]
    for name, sinogram in results.items():
        for kind, image, span in zip(
            ("sinogram", "slice"), (sinogram, rift.fbp(A, sinogram)), spans, strict=True
        ):
            grey = np.clip((image - span[0]) / (span[1] - span[0]), 0, 1)
            picture = folder / f"{name.replace(' ', '_')}_{kind}.png"
            imsave(picture, (255 * grey).astype(np.uint8), check_contrast=False)


if __name__ == "__main__":
    main(tyro.cli(Options))
