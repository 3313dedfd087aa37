"""Which projector costs least for the accuracy that is wanted.

``Projector`` costs something for every pixel of every view, ``FastProjector`` for every sample of a
view and for the transforms: the one wins where slices are small or views are few, the other from
some 150 samples along an edge up. Costs are counted, never timed, so that the choice, and with it
the result, does not depend on what else a machine does. Only a slice for which FastProjector has
too little memory is left to PhaseProjector, which takes slices in parts.
"""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError, check_type, checked_flag
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators.projector.parallel.fast_projector import FastProjector
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector
from rift_cl.operators.projector.parallel.ray_geometry import IMAGE, too_fine

# What FastProjector may differ by in norm. A uniform disc then comes back as flat as from
# Projector; with 1e-2 it is twice as rough at 360 views, though the phantom loses 0.01 dB alone.
_ERROR = 1e-3


class _Costs(NamedTuple):
    """Nanoseconds of a slice's backprojection, on one core of a CPU or on a whole GPU.

    Args:
        pixel: of ``Projector``, for a pixel of a view.
        bin: of ``Projector``, for a bin of a view.
        sample: of ``FastProjector``, for a sample of a view's transform that is kept.
        point: of ``FastProjector``, for a number that is transformed.
        launches: of ``Projector``'s kernels.
        fast_launches: of those of ``FastProjector``.
    """

    pixel: float
    bin: float
    sample: float
    point: float
    launches: float
    fast_launches: float


# Fitted to filtered backprojections of single slices at 64 to 512 pixels on two cores under PoCL.
# Those of a GPU are a guess: they were set by a few times of one GPU that were not kept, with
# kernels that have changed since, and only decide which projector is taken. The number of slices
# does not count, though several at once cost less each: a slice is to come out the same alone and
# in a stack.
_COSTS = {
    "cpu": _Costs(0.17, 4.0, 20.0, 5.0, launches=1e5, fast_launches=1e5),
    "gpu": _Costs(0.0018, 0.05, 2.0, 0.95, launches=3e5, fast_launches=7.1e6),
}


def cheapest_projector(
    grid: Grid,
    scan: Parallel,
    *,
    iterative: bool = False,
    error: float | None = None,
    footprint: str | None = None,
    device: Device | None = None,
) -> ParallelProjector:
    """The projector of a parallel scan that costs least, by a fixed model of what each costs.

    Args:
        grid: the grid of the image, (ny, nx), or of the volume, (nz, ny, nx).
        scan: angles and detector.
        iterative: whether a solver will use it, rather than ``fbp`` or ``backproject``.
        error: relative error of ``FastProjector``; 1e-3 if not given, which costs filtered
            backprojection less than 0.05 dB.
        footprint: of ``Projector``, which is then the one that is returned.
        device: the device to use; the default device if not given.

    Raises:
        InputError: footprint and error are both given, or one of them cannot be, or the scan is
            not parallel.
    """
    if not isinstance(scan, Parallel):
        raise InputError(
            f"scan is a {type(scan).__name__}, wanted a Parallel: other scans have one projector, "
            "Projector(grid, scan)"
        )
    if footprint is not None and error is not None:
        raise InputError(
            f"footprint is {footprint!r} and error {error!r}: a footprint is Projector's, an error "
            "FastProjector's; give one of them"
        )
    device = device or default_device()
    check_type("cheapest_projector", "grid", grid, Grid)
    checked_flag("cheapest_projector", "iterative", iterative)
    check_type("cheapest_projector", "device", device, Device)
    if footprint is not None:
        return PhaseProjector(grid, scan, footprint, device=device)
    if too_fine(grid, scan):
        return PhaseProjector(grid, scan, device=device)
    # Steps that keep an image from negative values lose up to 0.3 dB on 64 x 64 pixels where the
    # spectrum ends with what the image shows.
    lobes = 1 if iterative else IMAGE
    fast = FastProjector(grid, scan, _ERROR if error is None else error, lobes=lobes, device=device)
    costs = _COSTS["cpu" if device.traits.is_cpu else "gpu"]
    if _fast_cost(fast, costs) >= _direct_cost(grid, scan, costs):
        return PhaseProjector(grid, scan, device=device)
    if fast.fits:
        return fast
    warnings.warn(
        f"FastProjector's transforms of a slice of {grid.shape[-2]} x {grid.shape[-1]} samples do "
        f"not fit the memory of {device.name} (at most {format_bytes(device.budget)}, and "
        f"{format_bytes(device.traits.allocation)} for one array): Projector is used, which takes "
        "a slice in parts and is slower",
        stacklevel=2,
    )
    return PhaseProjector(grid, scan, device=device)


def _direct_cost(grid: Grid, scan: Parallel, costs: _Costs) -> float:
    each = math.prod(grid.shape[-2:]) * costs.pixel + scan.bins * costs.bin
    return len(scan.angles) * each + costs.launches


def _fast_cost(fast: FastProjector, costs: _Costs) -> float:
    rows, columns = fast.gridding.edges
    # Views share a complex transform in pairs, and so do rows of the image; of the grid one half is
    # stored.
    points = (
        len(fast.scan.angles) * fast.period + rows * columns + fast.grid.shape[-2] * columns
    ) / 2
    return sum(fast.samples) * costs.sample + points * costs.point + costs.fast_launches
