"""Which reconstruction a scan takes: slices one by one, or a volume at once."""

from __future__ import annotations

from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings


def reconstruction_of(
    settings: ReconstructSettings, *, joins: bool = False
) -> Reconstruction | ConeReconstruction:
    """The reconstruction of the settings' scan, planned; nothing is written yet.

    Args:
        settings: what to do.
        joins: whether parts of a run are to be done that another process has begun.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """
    settings.check()
    file = settings.open_scan(fan=True)
    if file.cone is None:
        return Reconstruction(settings, file)
    return ConeReconstruction(settings, file, joins=joins)
