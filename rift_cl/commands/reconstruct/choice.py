"""Which reconstruction a scan takes: slices one by one, or a volume at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rift_cl.cluster.address import ClusterAddress
from rift_cl.cluster.fork_server import begin_server
from rift_cl.commands.reconstruct.settings import ReconstructSettings

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
    from rift_cl.commands.reconstruct.job import Reconstruction

# What a worker of this machine needs for its first slices.
_OF_WORKERS = (
    "rift_cl.commands.devices.driver_test",
    "rift_cl.commands.reconstruct.cone_job",
    "rift_cl.commands.reconstruct.job",
    "rift_cl.commands.reconstruct.spread",
)


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
    if _has_own_workers(settings):
        begin_server(_OF_WORKERS)
    # Imported when used, which takes a while: the workers' server does the same beside it.
    from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
    from rift_cl.commands.reconstruct.job import Reconstruction

    file = settings.open_scan(fan=True)
    if file.cone is None:
        return Reconstruction(settings, file)
    return ConeReconstruction(settings, file, joins=joins)


def _has_own_workers(settings: ReconstructSettings) -> bool:
    """Whether a run will begin workers on this machine."""
    spreads = not (settings.cluster is None or settings.preview or settings.dry_run)
    return spreads and ClusterAddress.of(settings.cluster or "").workers > 0
