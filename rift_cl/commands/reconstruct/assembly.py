"""The volume of a run, put together while its slabs come, by whoever they are made.

A slab is kept first, as a file of its own, so that a run which is cut off can be gone on with in
any format (``kept_slabs``). Then it goes into the volume, in whatever order slabs come; the volume
has no name before all are in it. The one thread that does so works while slices are made, so that
little is left to do after the last of them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.errors import OutputError
from rift_cl.io.volumes import VolumeWriter

Floats = NDArray[np.float32]
# Takes the number of a first slice, and slices.
TakeSlab: TypeAlias = Callable[[int, Floats], None]


class Assembly:
    """Puts a volume together; use it in a ``with`` statement.

    Leaving it without an exception makes the volume appear. One thread at a time may use it.

    Args:
        kept: the slabs of the run.
        opened: opens the volume.
        takers: what else looks at every slice once, such as a preview.
        waits: whether the volume cannot be opened before all slices are there, since they decide
            what its integers stand for.
    """

    def __init__(
        self,
        kept: SlabFolder,
        opened: Callable[[], VolumeWriter],
        *takers: TakeSlab,
        waits: bool = False,
    ) -> None:
        self._kept, self._opened, self._takers, self._waits = kept, opened, takers, waits
        self._stack = ExitStack()
        self._volume: VolumeWriter | None = None
        self._taken = np.zeros(kept.shape[0], np.bool_)

    @property
    def clipped(self) -> tuple[int, int]:
        """How many samples were clipped at the lower and at the upper end of the window."""
        return (0, 0) if self._volume is None else self._volume.clipped

    def __enter__(self) -> Assembly:
        if not self._waits:
            self._open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def keep(self, start: int, slab: Floats) -> None:
        """Keep slices from number ``start`` on, and take whatever is kept.

        Raises:
            OutputError: the disk cannot be written to.
        """
        self._kept.save(start, slab)
        if self._volume is not None:
            # Rather than read what is in memory yet.
            self.take(start, slab)
        self.catch_up()

    def catch_up(self) -> None:
        """Take the slices that are kept and were not taken; none while the volume must wait.

        Raises:
            CheckpointError: a slab is damaged.
            OutputError: the volume cannot be written.
        """
        if self._volume is not None:
            for start, slab in self._kept.slabs(but=self._taken):
                self.take(start, slab)

    def complete(self) -> None:
        """Take what is left, once all slices are kept.

        Raises:
            CheckpointError: a slab is damaged.
            OutputError: the volume cannot be written.
        """
        if self._volume is None:
            self._open()
        self.catch_up()

    def take(self, start: int, slab: Floats) -> None:
        """Put slices from number ``start`` on into the volume.

        Raises:
            OutputError: it cannot be written, or is not open yet.
        """
        if self._volume is None:
            raise OutputError(f"{self._kept.path}: the volume is not open yet")
        self._volume.write(start, slab)
        self._taken[start : start + len(slab)] = True
        for take in self._takers:
            take(start, slab)

    def _open(self) -> None:
        self._volume = self._stack.enter_context(self._opened())
