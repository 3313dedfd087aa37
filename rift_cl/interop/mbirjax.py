"""MBIRJAX's cone beam as a scan, and back.

    arguments, parameters = to_mbirjax(scan)
    model = mbirjax.ConeBeamModel(**arguments)
    model.set_params(**parameters)
    scan = from_mbirjax(**arguments, **parameters)

Projections pass as they are, (views, rows, channels). A reconstruction of MBIRJAX's, (rows, cols,
slices), has y pointing the other way: ours is ``recon[::-1].transpose(2, 0, 1)``, and MBIRJAX's is
``volume.transpose(1, 2, 0)[::-1]``. A voxel's channel is ``(u + det_channel_offset) /
delta_det_channel`` from the middle, so that the axis is seen at a higher channel for a positive
offset; ``helical_z_shifts`` are our heights. Source: ``ConeBeamModel`` of MBIRJAX 0.7. MBIRJAX
itself is not needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.interop.circular import number_of, numbers_of

__all__ = ["from_mbirjax", "to_mbirjax"]


def from_mbirjax(
    sinogram_shape: tuple[int, int, int],
    angles: ArrayLike,
    source_detector_dist: float,
    source_iso_dist: float,
    *,
    delta_det_channel: float = 1.0,
    delta_det_row: float = 1.0,
    det_channel_offset: float = 0.0,
    det_row_offset: float = 0.0,
    helical_z_shifts: ArrayLike | None = None,
    use_curved_detector: bool = False,
) -> Cone:
    """Read the parameters of MBIRJAX's ``ConeBeamModel``.

    Args:
        sinogram_shape: (views, rows, channels).
        angles: (views,) radians.
        source_detector_dist: distance of the source from the detector.
        source_iso_dist: distance of the source from the axis.
        delta_det_channel: distance of channels.
        delta_det_row: distance of rows.
        det_channel_offset: offset of the detector along the channels, a length.
        det_row_offset: the same along the rows.
        helical_z_shifts: (views,) heights of the source.
        use_curved_detector: channels on an arc about the source.

    Raises:
        ShapeError: an array has another shape.
        InputError: a number is none.
    """
    views, rows, bins = (int(n) for n in numbers_of("MBIRJAX", "", sinogram_shape, shape=(3,)))
    pitch = (
        number_of("MBIRJAX", "delta_det_row", delta_det_row),
        number_of("MBIRJAX", "delta_det_channel", delta_det_channel),
    )
    center = (
        (rows - 1) / 2 + det_row_offset / pitch[0],
        (bins - 1) / 2 + (det_channel_offset / pitch[1]),
    )
    return Cone(
        numbers_of("MBIRJAX", "angles", angles, shape=(views,)),
        rows,
        bins,
        pitch,
        source_iso_dist,
        source_detector_dist,
        center,
        helical_z_shifts,
        use_curved_detector,
    )


def to_mbirjax(scan: Cone) -> tuple[dict[str, Any], dict[str, Any]]:
    """Describe a scan for MBIRJAX.

    Returns:
        The arguments of ``ConeBeamModel``, and those of its ``set_params``.

    Raises:
        InputError: the scan is no ``Cone``.
    """
    if not isinstance(scan, Cone):
        raise InputError(f"MBIRJAX: the scan is a {type(scan).__name__}, wanted a Cone")
    off = (np.array(scan.center) - (np.array([scan.rows, scan.bins]) - 1) / 2) * scan.pitch
    arguments: dict[str, Any] = {
        "sinogram_shape": (scan.views, scan.rows, scan.bins),
        "angles": scan.angles.copy(),
        "source_detector_dist": scan.source_to_detector,
        "source_iso_dist": scan.source_to_axis,
    }
    if np.any(scan.heights != 0):
        arguments["helical_z_shifts"] = scan.heights.copy()
    if scan.curved:
        arguments["use_curved_detector"] = True
    return arguments, {
        "delta_det_channel": scan.pitch[1],
        "delta_det_row": scan.pitch[0],
        "det_channel_offset": float(off[1]),
        "det_row_offset": float(off[0]),
    }
