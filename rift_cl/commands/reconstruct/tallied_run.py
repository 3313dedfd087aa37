"""What reconstructions by slices and by cones count and tell alike, here and in workers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rift_cl.commands.inputs.detector_rows import dead_rows_words

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.cone_input import ConeInput
    from rift_cl.commands.reconstruct.cone_job import ConeInversion
    from rift_cl.commands.reconstruct.inversion import Inversion
    from rift_cl.commands.reconstruct.slice_input import SliceInput
    from rift_cl.commands.reconstruct.spread import Receipt
    from rift_cl.reconstruct import Attenuation


class TalliedRun:
    """A run with figures that are added up.

    Subclasses set ``announce``, which tells a person a sentence, ``metrics``, ``source`` and
    ``inversion``.
    """

    announce: Callable[[str], None]
    metrics: dict[str, Any]
    source: SliceInput | ConeInput
    inversion: Inversion | ConeInversion

    def take(self, receipt: Receipt) -> None:
        """Take what a worker tells of the slices that it made."""
        self._count(**receipt.figures)
        self.source.clean.zingers += receipt.zingers
        self.inversion.residuals.update(receipt.residuals)
        self.inversion.weights.update(receipt.weights)

    def _mended(self, integrals: Attenuation) -> None:
        """Count what was filled in rows that were read, and name those that are dead."""
        self._count(dead_pixels=integrals.dead, starved_samples=integrals.starved)
        if integrals.dead_rows:
            self._say(dead_rows_words(integrals.dead_rows))

    def _count(self, **found: int) -> None:
        """Add to the figures of the run."""
        self.metrics.update({name: self.metrics.get(name, 0) + n for name, n in found.items()})

    def _say(self, *sentences: str) -> None:
        """Tell what became of the slices, now and in the report."""
        self.source.notes.extend(sentences)
        for sentence in sentences:
            self.announce(sentence)
