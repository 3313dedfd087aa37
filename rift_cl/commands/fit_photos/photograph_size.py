"""Default downscaling of photographs for a fit.

The time of a step grows with the number of pixels, and phones give 12 million of them, finer than
the splats of a usual fit. 1.6 megapixels are what splats are usually fitted at (the code of Kerbl
et al. 2023 makes wider pictures 1,600 pixels wide); a processor gets less than half of that, which
leaves the 800 x 800 of synthetic captures as they are. The decision hangs on the photographs and on
the kind of device alone, so that a fit that goes on decides alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.io.captures.capture import View, camera_at
from rift_cl.metrics.scores import SSIM_WINDOW

# Most pixels of a photograph, on a processor and on a GPU.
MOST_PIXELS = {True: 700_000, False: 1_600_000}


def fitting_downscale(views: Sequence[View], device: Device) -> int:
    """The least whole factor that leaves no photograph larger than this device fits in good time.

    Args:
        views: the photographs, one or more.
        device: what fits them.
    """
    return factor_for(max(view.camera.height * view.camera.width for view in views), device)


def factor_for(pixels: int, device: Device) -> int:
    """The same for the pixels of the largest photograph."""
    return max(1, math.ceil(math.sqrt(pixels / MOST_PIXELS[device.traits.is_cpu])))


def check_window(views: Sequence[View], factor: int, *, way_out: str = "") -> None:
    """Check that photographs are as large as the window of SSIM, before any work is done.

    Args:
        views: the photographs whose SSIM is in the loss or among the scores.
        factor: by which they are made smaller.
        way_out: what may be done besides a smaller factor.

    Raises:
        InputError: one is smaller.
    """
    smallest = min(views, key=lambda view: min(view.camera.size), default=None)
    if smallest is None:
        return
    camera, most = camera_at(smallest, factor), min(smallest.camera.size) // SSIM_WINDOW
    if factor <= most:
        return
    larger = f"take --downscale {most}" + (" or less" if most > 1 else "")
    ways = ", or ".join(filter(None, [larger if most else "", way_out]))
    raise InputError(
        f"--downscale {factor} leaves {camera.width} x {camera.height} pixels of {smallest.name}, "
        f"and SSIM wants {SSIM_WINDOW} or more along each side{f': {ways}' if ways else ''}"
    )


def size_words(views: Sequence[View], factor: int) -> str:
    """What a factor makes of the largest photograph, in a sentence."""
    largest = max(views, key=lambda view: view.camera.height * view.camera.width)
    small = camera_at(largest, factor)
    return (
        f"photographs of {largest.camera.width} x {largest.camera.height} pixels are fitted at "
        f"{small.width} x {small.height}; --downscale 1 fits them as they are, in about "
        f"{factor**2} times the time"
    )
