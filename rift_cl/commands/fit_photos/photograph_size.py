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
from rift_cl.io.captures.capture import View, camera_at

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


def size_words(views: Sequence[View], factor: int) -> str:
    """What a factor makes of the largest photograph, in a sentence."""
    largest = max(views, key=lambda view: view.camera.height * view.camera.width)
    small = camera_at(largest, factor)
    return (
        f"photographs of {largest.camera.width} x {largest.camera.height} pixels are fitted at "
        f"{small.width} x {small.height}; --downscale 1 fits them as they are, in about "
        f"{factor**2} times the time"
    )
