"""How well views sample each frequency of a target: the driver of ``kernels/sampling/coverage.cl``.

``host`` says what coverage is and computes the same in float64. On the device lengths are in
diameters of the target, so that float32 holds them in any unit; its results agree with the host's
to 2e-5 of the largest up to a thousand cycles per diameter, and lose a digit for each factor of ten
beyond.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.errors import NonFiniteError, ShapeError
from rift_cl.geometry.numbers import real_numbers
from rift_cl.sampling.coverage.work import BOX, ROW, RUN, CoverageWork, Views
from rift_cl.sampling.targets.observations import ObservationsGradient
from rift_cl.sampling.targets.target import Target


def coverage(
    views: Views,
    target: Target,
    k: ArrayLike | None = None,
    *,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> NDArray[np.float32]:
    """How well views sample frequencies, at each point of a target.

    Args:
        views: cameras, a scan (parallel, fan, cone or vectors), or ``Observations`` at the target's
            points.
        target: its points and diameter.
        k: (K, 3) cycles per unit of the world; those of the target by default.
        weights: (V,) relative photons of cameras; 1 each by default.
        device: where to compute; the default device if not given.

    Returns:
        (P, K): 1 where one view of weight 1 sees a frequency in full, 0 where none does.

    Raises:
        ShapeError: an array has the wrong shape, or there is no view.
        InputError: a number is not finite or out of its range.
        ResourceLimitError: the memory budget holds not even a few frequencies.
    """
    work = CoverageWork.of(views, target, k, weights, device)
    found = np.empty((work.points, work.padded), np.float32)
    for points, table in work.point_chunks():
        each = work.lanes * 4 * (3 + len(table)) + 4 * BOX
        chunks = plan_chunks(
            len(work.boxes),
            each,
            table.nbytes,
            work.device.budget,
            what="few frequencies",
            array=max(work.lanes * 4 * max(3, len(table)), 4 * BOX),
            largest=work.device.traits.allocation,
        )
        for chunk in chunks:
            at = slice(chunk.start * work.lanes, chunk.stop * work.lanes)
            part = work.device.empty((len(table), at.stop - at.start))
            size = (chunk.stop - chunk.start, len(table))
            work.device.launch("coverage", size, **work.send(at), views=table, covered=part)
            found[points, at] = work.device.get(part)
    return found[:, : work.wanted]


def coverage_grad(
    views: Views,
    target: Target,
    grad: ArrayLike,
    k: ArrayLike | None = None,
    *,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> ObservationsGradient:
    """The gradient of a number by the views, from its gradient by ``coverage``.

    Args:
        views: as given to ``coverage``, as are the rest but one.
        target: its points and diameter.
        grad: (P, K) the gradient by what ``coverage`` returned.
        k: (K, 3) cycles per unit of the world.
        weights: (V,) relative photons of cameras.
        device: where to compute.

    Returns:
        In float64, with (V, P, 3) and (V, P) entries; that by the direction lies across it.

    Raises:
        ShapeError: an array has the wrong shape, or there is no view.
        InputError: a number is not finite or out of its range.
        ResourceLimitError: the memory budget holds not even one run of frequencies.
    """
    work = CoverageWork.of(views, target, k, weights, device)
    upstream = np.zeros((work.points, work.padded), np.float32)
    upstream[:, : work.wanted] = _upstream(grad, (work.points, work.wanted))
    total = np.zeros((work.points, work.views, ROW))
    for points, table in work.point_chunks():
        for parts in _parts(work, table, upstream[points]):
            # One by one, so that the order of the sum is that of the runs however they are cut.
            for part in work.device.get(parts):
                total[points] += part
    return work.in_world(total.transpose(1, 0, 2))


def _parts(
    work: CoverageWork, table: DeviceArray, upstream: NDArray[np.float32]
) -> Iterator[DeviceArray]:
    """The gradients by runs of frequencies, in their order: (runs, points, V, 8) at a time."""
    boxes = RUN // work.lanes * 4 * BOX
    each = RUN * 4 * (3 + len(table)) + boxes + table.nbytes
    chunks = plan_chunks(
        -(-work.padded // RUN),
        each,
        table.nbytes,
        work.device.budget,
        what="run of frequencies",
        array=max(RUN * 4 * max(3, len(table)), boxes, table.nbytes),
        largest=work.device.traits.allocation,
    )
    for chunk in chunks:
        at = slice(chunk.start * RUN, min(chunk.stop * RUN, work.padded))
        parts = work.device.empty((chunk.stop - chunk.start, *table.shape))
        work.device.launch(
            "coverage_grad",
            (work.views, len(table), chunk.stop - chunk.start),
            **work.send(at),
            views=table,
            upstream=work.device.array(np.ascontiguousarray(upstream[:, at])),
            parts=parts,
            point_count=len(table),
            RUN=RUN,
        )
        yield parts


def _upstream(grad: ArrayLike, shape: tuple[int, int]) -> NDArray[np.float64]:
    values = real_numbers(grad)
    if values is None or values.shape != shape:
        raise ShapeError(f"grad has shape {np.shape(grad)}, wanted {shape}, as coverage returns")
    if not np.isfinite(values).all():
        raise NonFiniteError("grad holds NaN or infinity")
    return values
