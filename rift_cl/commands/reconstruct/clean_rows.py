"""Rows of a scan as clean line integrals: what a detector gets wrong is put right here.

In this order, each step where it was asked for or is called for: flat-field correction and the
logarithm, zingers, phase retrieval, beam hardening, stripes, a tilted or wandering axis. A step
that looks at neighbouring rows is given as many more as it needs, so that slices do not depend on
how the rows were cut into slabs.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.axis_alignment import Alignment
from rift_cl.commands.inputs.scan_axis import ZINGER_HALO
from rift_cl.commands.inputs.scan_rows import read_attenuation
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.errors import InputError
from rift_cl.io.scans.scan_file import ScanFile
from rift_cl.reconstruct import Attenuation
from rift_cl.reconstruct.preprocess import (
    Propagation,
    linearised,
    paganin,
    remove_rings,
    remove_zingers,
)

Floats = NDArray[np.float32]
_USUAL_RINGS = "vo"
# Stripes are told from the object where views go round so far: a flat face is a stripe in fewer.
_RINGS_FROM = np.deg2rad(150)
# Options of phase retrieval, all of which it needs.
_PHASE = ("delta_beta", "energy", "propagation")


class LoadedRows(NamedTuple):
    """Rows as they were read.

    Args:
        start: the first row that is wanted.
        stop: the one after the last.
        kept: the same of the rows that are left when all but the axis is corrected.
        first: number of the first row that was read.
        integrals: line integrals of the rows that were read.
    """

    start: int
    stop: int
    kept: tuple[int, int]
    first: int
    integrals: Attenuation


class CleanRows:
    """Reads rows of a scan and corrects them.

    Args:
        scan: the scan.
        settings: what is to be corrected.
        pixel: height and width of a detector pixel in metres, as phase retrieval needs them; None
            if unknown.
        device: where to compute.

    Raises:
        InputError: an option lacks another, or does not fit the scan.
    """

    def __init__(
        self,
        scan: ScanFile,
        settings: ReconstructSettings,
        pixel: tuple[float, float] | None,
        device: Device,
    ) -> None:
        self._scan, self._settings, self._device = scan, settings, device
        self.rings = self._ring_method()
        self.phase = self._propagation(pixel)
        # Zingers that were removed in the rows that were read since it was last set to zero.
        self.zingers = 0
        # Set once the axis is known, where it is not at one bin.
        self.alignment: Alignment | None = None

    def read(self, start: int, stop: int) -> Attenuation:
        """Line integrals of some rows."""
        return self.clean(self.load(start, stop))

    def load(self, start: int, stop: int) -> LoadedRows:
        """Read rows, and the neighbours that corrections need.

        Works on the host alone, so that another thread than the one that uses the device can do it.
        """
        bins = self._scan.shape[2]
        turned = 0 if self.alignment is None else self.alignment.halo(bins)
        kept = self._around(start, stop, turned)
        first, last = self._around(*kept, self._halo)
        return LoadedRows(start, stop, kept, first, read_attenuation(self._scan, first, last))

    def clean(self, loaded: LoadedRows) -> Attenuation:
        """Correct what was loaded.

        What was mended in the neighbours of the rows that are wanted is not counted: it is where
        they are wanted themselves.
        """
        (first, last), rows = loaded.kept, loaded.integrals.projections
        kept = slice(first - loaded.first, last - loaded.first)
        counted = slice(loaded.start - loaded.first, loaded.stop - loaded.first)
        if self._settings.zingers is not None:
            rows = self._without_zingers(rows, counted)
        if self.phase is not None:
            rows = paganin(np.exp(-rows), **_arguments(self.phase))
        rows = np.ascontiguousarray(rows[:, kept])
        if self._settings.hardening is not None:
            rows = linearised(rows, self._settings.hardening)
        if self.rings is not None:
            rows = remove_rings(rows, method=self.rings, device=self._device)
        if self.alignment is not None:
            wanted = slice(loaded.start - first, loaded.stop - first)
            rows = self.alignment.aligned(rows, first, wanted, self._device)
        found = loaded.integrals
        dead, starved = found.dead_of_rows[counted], found.starved_of_rows[counted]
        lost = tuple(row for row in found.dead_rows if loaded.start <= row < loaded.stop)
        return Attenuation(rows, dead, starved, found.dead_bins, found.stuck_bins, lost)

    @property
    def _halo(self) -> int:
        """Neighbouring rows that zinger removal and phase retrieval need."""
        halo = 0 if self.phase is None else self.phase.halo_rows()
        return halo + (0 if self._settings.zingers is None else ZINGER_HALO)

    def _without_zingers(self, rows: Floats, counted: slice) -> Floats:
        sigma = self._settings.zingers or 0.0
        # Line integrals that others computed stray to either side: from lost counts, too.
        clean, _ = remove_zingers(
            rows,
            sigma=sigma,
            dark=self._scan.kind == "attenuation",
            kind="attenuation",
            device=self._device,
        )
        self.zingers += int(np.count_nonzero(clean[:, counted] != rows[:, counted]))
        return clean

    def _around(self, start: int, stop: int, halo: int) -> tuple[int, int]:
        return max(0, start - halo), min(self._scan.shape[1], stop + halo)

    def notes(self) -> list[str]:
        """What is corrected, a sentence each."""
        notes = []
        if self.phase is not None:
            blur = self.phase.decay_length / self.phase.edges[1]
            notes.append(
                f"Phase was retrieved after Paganin et al. (2002): delta/beta "
                f"{self.phase.delta_beta:g}, {self.phase.energy:g} keV, "
                f"{1e3 * self.phase.distance:g} mm, a filter of {blur:.3g} pixels."
            )
            doubt = self.phase.doubt(self._scan.shape[2])
            notes += [f"Doubt: {doubt}"] if doubt else []
        if self._settings.zingers is not None:
            notes.append(
                "Zingers, single pixels that stand out from their neighbours by "
                f"{self._settings.zingers:g} standard deviations, are looked for and replaced; "
                "of a whole run 'zingers' is how many."
            )
        if self._settings.hardening is not None:
            terms = " + ".join(
                f"{a:g} y^{k}" if k > 1 else f"{a:g} y"
                for k, a in enumerate(self._settings.hardening, 1)
            )
            notes.append(f"Beam hardening: line integrals y were replaced by {terms}.")
        if self.rings is not None:
            notes.append(f"Stripes were removed from the projections, method {self.rings} (rings).")
        if self.alignment is not None:
            notes.append(self.alignment.words)
        return notes

    def _ring_method(self) -> str | None:
        """How stripes are removed; None if they are not."""
        wanted = self._settings.rings
        if wanted == "off":
            return None
        if wanted != "auto":
            return _USUAL_RINGS if wanted == "on" else wanted
        # In views that are all alike, everything is a stripe.
        wide = np.ptp(self._scan.angles) >= _RINGS_FROM and self._settings.repeat is None
        return _USUAL_RINGS if self._scan.kind != "attenuation" and wide else None

    def _propagation(self, pixel: tuple[float, float] | None) -> Propagation | None:
        settings = self._settings
        given = [name for name in _PHASE if getattr(settings, name) is not None]
        if not given:
            return None
        missing = [name.replace("_", "-") for name in _PHASE if name not in given]
        if missing:
            raise InputError(
                f"phase retrieval needs --delta-beta, --energy and --propagation: --{missing[0]} "
                "is missing"
            )
        if self._scan.fan is not None or self._scan.cone is not None:
            raise InputError(
                f"{self._scan.path}: phase retrieval is for parallel rays, these diverge"
            )
        if pixel is None:
            raise InputError(
                "phase retrieval needs the size of a detector pixel: give --pitch and --unit, such "
                "as --pitch 0.65 --unit um"
            )
        if self._scan.shape[1] < 2:
            raise InputError(
                f"{self._scan.path}: phase retrieval needs the rows above and below, the scan has "
                "a single one"
            )
        assert settings.propagation is not None
        distance = settings.propagation * 1e-3
        return Propagation(pixel, distance, settings.energy, settings.delta_beta)  # type: ignore[arg-type]


def _arguments(phase: Propagation) -> dict[str, Any]:
    return {field.name: getattr(phase, field.name) for field in dataclasses.fields(phase)}
