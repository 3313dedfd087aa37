"""Which reconstruction a scan takes: slices one by one, or a volume at once."""

from __future__ import annotations

from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings


def reconstruction_of(settings: ReconstructSettings) -> Reconstruction | ConeReconstruction:
    """The reconstruction of the settings' scan, planned; nothing is written yet.

    Raises:
        RiftError: anything about the settings, the file, the device or the folder is wrong.
    """
    settings.check()
    file = settings.open_scan(fan=True)
    if file.cone is None:
        return Reconstruction(settings, file)
    return ConeReconstruction(settings, file)
