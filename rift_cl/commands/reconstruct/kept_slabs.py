"""Slices that are done stay: what a reconstruction keeps, so that it can be gone on with.

Every slab is a file of its own, ``slabs/00016-00032.npy``, beside ``slabs/run.json`` which says of
what run they are. They become the volume when all are there, and go then. What was kept is known
by the slices and not by the slabs, which differ with the memory that is free.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.reconstruct.report import PREVIEW_PICTURE
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.volume import volume_path
from rift_cl.commands.run_folder.run_folder import RunFolder, difference, is_unfinished
from rift_cl.errors import CheckpointError, InputError, OutputError, StoppedError
from rift_cl.io.boundary import reading
from rift_cl.io.folder_lock import LOCK_NAME
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import atomic_path, check_space, make_folder, write_json, writing

Floats = NDArray[np.float32]
_SLAB = re.compile(r"(\d{5,})-(\d{5,})\.npy")
_RUN = "run.json"
# Beside what decides the slices: which process spreads the run over workers, and the projector,
# which is not compared but taken.
_TOKEN, _PROJECTION = "token", "projection"


class SlabFolder:
    """The slabs of one run.

    Args:
        path: the folder; made by ``begin``.
        shape: (z, y, x) of the volume; set anew once the axis is known, which may decide it.
    """

    def __init__(self, path: Path, shape: tuple[int, int, int]) -> None:
        self.path, self.shape = path, shape
        self.token: str | None = None
        """Slabs are kept only while the run is marked with it; None: without a look."""

    @property
    def begun(self) -> bool:
        """Whether an earlier run left something to go on with."""
        return (self.path / _RUN).is_file()

    def begin(
        self, run: Mapping[str, Any], projection: Mapping[str, float | str] | None = None
    ) -> None:
        """Begin anew: drop what an earlier run left.

        Args:
            run: what decides the slices, by name.
            projection: the setting that decides the projector, by name.
        """
        self.drop()
        make_folder(self.path)
        # The slabs stay until the volume that is made of them is complete.
        check_space(self.path / _RUN, 2 * 4 * int(np.prod(self.shape)))
        write_json(self.path / _RUN, {**run, _PROJECTION: dict(projection or {})})

    def mark(self) -> str:
        """Mark the run anew, so that workers of an earlier one keep nothing in it any more.

        Returns:
            The token of its workers.
        """
        token = secrets.token_hex(16)
        write_json(self.path / _RUN, {**self._recorded(), _TOKEN: token})
        return token

    def axis(self) -> tuple[float, float, bool] | None:
        """The rotation axis of the run that was begun, if it had one.

        Returns:
            Its bin, its tilt, and whether a fan's angles were reversed.
        """
        recorded = self._recorded()
        turned = recorded.get("angles") == "reversed"
        try:
            return float(recorded["axis"]), float(recorded["tilt of the axis"]), turned
        except (KeyError, TypeError, ValueError):
            return None

    def projection(self) -> dict[str, Any]:
        """The setting that decided the projector when the run began; none if it is not recorded.

        Raises:
            CheckpointError: the record is damaged.
        """
        found = self._recorded().get(_PROJECTION, {})
        kinds = {"error": float, "footprint": str}
        if isinstance(found, dict) and all(
            name in kinds and isinstance(value, kinds[name]) for name, value in found.items()
        ):
            return dict(found)
        raise CheckpointError(
            f"{self.path / _RUN}: {_PROJECTION} is {found!r}, wanted an error or a footprint: "
            "begin anew with --overwrite"
        )

    def go_on(self, run: Mapping[str, Any]) -> None:
        """Make sure that what is there belongs to this run.

        Reads nothing but the record, and changes nothing.

        Args:
            run: what decides the slices.

        Raises:
            CheckpointError: it does not; the sentence names what differs.
        """
        before = {
            what: fact
            for what, fact in self._recorded().items()
            if what not in (_TOKEN, _PROJECTION)
        }
        check_same(self.path, "the run that was cut off", before, run)

    def _recorded(self) -> dict[str, Any]:
        try:
            return dict(read_json_object(self.path / _RUN).values)
        except InputError as error:
            raise CheckpointError(f"{error}: begin anew with --overwrite") from error

    @property
    def done(self) -> int:
        """How many slices are there."""
        return int(self.shape[0] - sum(run.stop - run.start for run in self.missing()))

    def missing(self) -> list[slice]:
        """Runs of slices that are not there yet, in order."""
        there = np.zeros(self.shape[0], np.bool_)
        for start, stop, _ in self._files():
            there[start:stop] = True
        return _runs_without(there)

    def save(self, start: int, slices: Floats) -> None:
        """Keep a slab.

        Raises:
            CheckpointError: the run in the folder is not that of ``token`` any more.
        """
        path = self.path / f"{start:05d}-{start + len(slices):05d}.npy"
        # Two workers may make the same slab at a time, where one was given up too early.
        own = path.with_name(f"{path.stem}-{socket.gethostname()}-{os.getpid()}.npy")
        try:
            with atomic_path(own) as part, part.open("wb") as out:
                np.save(out, np.ascontiguousarray(slices, np.float32), allow_pickle=False)
            if self.token is not None and self._recorded().get(_TOKEN) != self.token:
                raise CheckpointError(f"{self.path}: the run was begun anew; this slab is dropped")
            with writing(path):
                own.replace(path)
        except BaseException:
            with suppress(OSError):
                own.unlink(missing_ok=True)
            raise

    def slabs(
        self,
        numbers: Collection[int] | None = None,
        but: NDArray[np.bool_] | None = None,
    ) -> Iterator[tuple[int, Floats]]:
        """Slabs and the numbers of their first slices, in order; no slice comes twice.

        Workers of unequal memory, one of which was lost, may have kept the same slice in two slabs.

        Args:
            numbers: slices that are wanted; slabs without any of them are left out.
            but: of each slice, whether it is not wanted.

        Raises:
            CheckpointError: one is damaged.
        """
        given = np.zeros(self.shape[0], np.bool_) if but is None else but.copy()
        for start, stop, path in self._files():
            if numbers is not None and not any(start <= number < stop for number in numbers):
                continue
            wanted = _runs_without(given[start:stop])
            if not wanted:
                continue
            slab = self._slab(start, stop, path)
            given[start:stop] = True
            for run in wanted:
                yield start + run.start, np.array(slab[run])

    def _slab(self, start: int, stop: int, path: Path) -> Floats:
        """A slab, mapped.

        Raises:
            CheckpointError: it is damaged.
        """
        try:
            # Mapped first, so that nothing is allocated for a size that is only claimed.
            with reading(path, "the slab"):
                slab = np.load(path, mmap_mode="r", allow_pickle=False)
        except InputError as error:
            raise CheckpointError(f"{error}; remove it and go on with --resume") from error
        if not isinstance(slab, np.ndarray):
            raise CheckpointError(f"{path}: holds no array; remove it and go on with --resume")
        if slab.shape != (stop - start, *self.shape[1:]) or slab.dtype != np.float32:
            raise CheckpointError(
                f"{path}: holds {slab.dtype} {slab.shape}, wanted float32 "
                f"{(stop - start, *self.shape[1:])}; remove it and go on with --resume"
            )
        return slab

    def slices(self, numbers: Collection[int]) -> list[Floats]:
        """Single slices, in the order in which they are kept."""
        slabs = self.slabs(numbers)
        return [
            slab[n - start] for start, slab in slabs for n in numbers if 0 <= n - start < len(slab)
        ]

    def drop(self) -> None:
        """Remove the folder."""
        if self.path.is_dir():
            with writing(self.path):
                shutil.rmtree(self.path)

    def _files(self) -> list[tuple[int, int, Path]]:
        if not self.path.is_dir():
            return []
        named = [(_SLAB.fullmatch(path.name), path) for path in self.path.iterdir()]
        found = sorted(
            (int(name[1]), int(name[2]), path) for name, path in named if name and path.is_file()
        )
        return [entry for entry in found if 0 <= entry[0] < entry[1] <= self.shape[0]]


def _runs_without(marked: NDArray[np.bool_]) -> list[slice]:
    """Runs of what is not marked, in order."""
    edges = np.flatnonzero(np.diff(np.pad(~marked, 1).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def check_same(path: Path, what: str, before: Mapping[str, Any], run: Mapping[str, Any]) -> None:
    """Make sure that two runs make the same slices.

    Raises:
        CheckpointError: they do not; the sentence names what differs.
    """
    differs = difference(before, run)
    if differs is not None:
        raise CheckpointError(f"{path}: {what} {differs}, or begin anew with --overwrite")


def finished_run(settings: ReconstructSettings) -> dict[str, Any] | None:
    """What decided the slices of the finished run in the folder; None where there is none.

    One whose volume is not there in the settings' format does not count.
    """
    try:
        config = read_json_object(settings.out / "config.json").values
        finished = config["complete"] and volume_path(settings).exists()
        return dict(config["run"]) if finished else None
    except (ValueError, LookupError, TypeError):
        return None


def stopped(kept: SlabFolder) -> StoppedError:
    """What is said when a run is broken off whose slices are kept."""
    return StoppedError(
        f"interrupted; {kept.done} of {kept.shape[0]} slices are kept: the same command with "
        "--resume goes on"
    )


def refuse_begun(settings: ReconstructSettings, kept: SlabFolder) -> None:
    """Refuse to begin where a run was cut off, unless it is said what shall become of it.

    Raises:
        OutputError: nothing is said.
    """
    if kept.begun and not (settings.resume or settings.overwrite or settings.dry_run):
        raise OutputError(
            f"{settings.out}: holds a reconstruction that was cut off: --resume goes on with it, "
            "--overwrite begins anew"
        )


def is_preview(out: Path) -> bool:
    """Whether a folder holds a preview and nothing else."""
    known = {PREVIEW_PICTURE, "config.json", LOCK_NAME}
    return out.is_dir() and {path.name for path in out.iterdir()} <= known


def run_folder(settings: ReconstructSettings, kept: SlabFolder) -> RunFolder:
    """The folder of a run, if it may be used.

    Raises:
        OutputError: it holds something that would be lost.
    """
    out, begun = settings.out, kept.begun
    refuse_begun(settings, kept)
    # One is there to be followed by the slices.
    alone = is_preview(out)
    # One that was killed before it kept anything is begun again.
    unfinished = is_unfinished(out, "reconstruct")
    there = begun or (settings.resume and (unfinished or finished_run(settings) is not None))
    return RunFolder(out, "reconstruct", overwrite=settings.overwrite or alone, resume=there)
