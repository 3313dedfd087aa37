"""The rotation axis of a scan in a file: one search for every command, so that all say the same."""

from __future__ import annotations

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.scan_rows import read_attenuation
from rift_cl.errors import InputError
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct.axis import AxisEstimate, axis_of_rows, searched_rows


def find_axis(
    scan: ScanFile, device: Device | None = None, *, span: tuple[float, float] | None = None
) -> AxisEstimate:
    """Find the rotation axis of a parallel-beam scan.

    Reads a few rows, evenly spread over the whole detector whichever of them are wanted as slices,
    one after the other, and uses their line integrals as they are: rings do not turn with the
    object, so that they contradict every centre alike.

    Args:
        scan: the scan.
        device: accepted as by every search; this one runs on the host.
        span: first and last bin between which to search; as for ``find_center`` if not given.

    Raises:
        InputError: the data do not tell the axis; the sentence names the file and says why.
        NonFiniteError: a sample is not finite.
    """
    del device
    count = scan.shape[1]
    rows = searched_rows(count)
    sinograms = (read_attenuation(scan, row, row + 1).projections[:, 0] for row in rows)
    try:
        return axis_of_rows(sinograms, rows, count, scan.angles, span)
    except InputError as error:
        raise type(error)(f"{scan.path}: {error}") from error
