"""``rift reconstruct`` as a function."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.volume import volume_path
from rift_cl.commands.run_folder.saved_settings import parsed_settings
from rift_cl.errors import InputError
from rift_cl.io import read_volume
from rift_cl.progress import Report


@dataclass(frozen=True)
class ReconstructedScan:
    """What a reconstruction left.

    Args:
        path: the volume: a folder of slices, a file or a store, by the format asked for.
        settings: the settings with every value that was decided.
        metrics: figures of the run by name, such as ``center`` and ``seconds``.
        notes: what was assumed of the scan and mended in it, a sentence each.
    """

    path: Path
    settings: ReconstructSettings
    metrics: dict[str, Any]
    notes: tuple[str, ...]

    def read(self, *, budget: int | None = None) -> NDArray[np.float32]:
        """The volume (z, y, x), attenuation per unit of length.

        Args:
            budget: bytes that it may take; 60 % of the free memory when not given.

        Raises:
            ResourceLimitError: it is larger than the budget.
        """
        return read_volume(self.path, budget=budget)


def reconstruct_scan(
    scan: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    progress: Callable[[Report], None] | None = None,
    **settings: Any,
) -> ReconstructedScan:
    """Reconstruct a scan, slice by slice, as ``rift reconstruct`` does.

    Args:
        scan: the scan's file or folder; see ``open_scan``.
        out: folder for the slices, preview.png, report.html, config.json and metrics.json.
        progress: is called with a report after every slab or step.
        **settings: the command's options by their names in Python, such as ``center=295.9`` or
            ``method="tv"``; see ``ReconstructSettings``.

    Raises:
        RiftError: a setting, the scan, the device or the folder cannot be used.
    """
    for name in ("config", "dry_run", "preview"):
        if settings.get(name):
            raise InputError(f"{name} is for 'rift reconstruct' alone: leave it out")
    given = {"scan": scan, "out": out, **settings}
    job = Reconstruction(parsed_settings(given, "reconstruct", ReconstructSettings))
    for report in job.run():
        if progress is not None:
            progress(report)
    return ReconstructedScan(
        volume_path(job.settings), job.decided, dict(job.metrics), tuple(job.source.notes)
    )
