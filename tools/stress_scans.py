"""Is any raw, ambiguous or mislabelled scan read wrongly without a word?

    python tools/stress_scans.py

Writes one object, of which the truth is known, into files of every format: counts with and without
flats, transmission, line integrals, transposed, keyed, with angles in the wrong unit. Each is
opened as a person would, corrected, and reconstructed by filtered backprojection. Prints for each
what it is, what was said and what became of it: right slices, a sentence, or slices that are wrong.
Ends with status 1 if one is wrong, or is not what the table wants.
"""

from __future__ import annotations

import sys
import tempfile
import textwrap
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from stress.known_object import BINS, CENTER, REFUSED, RIGHT, Case, cases, slices

# Right slices have at least this PSNR in dB (peak: the true densities' greatest), and a mean inside
# that is off by no more than this share.
_PSNR, _LEVEL = 24.0, 0.05
WRONG = "WRONG"


@dataclass(frozen=True)
class Options:
    """Read scans of which the truth is known.

    Args:
        only: part of what a file holds, in words; all of them if not given.
        width: of what was said, in characters; 0 for one line however long.
    """

    only: str = ""
    width: int = 100


@dataclass(frozen=True)
class Outcome:
    """What became of a file.

    Args:
        what: right, refused or wrong.
        said: the sentences that a person reads.
        psnr: of its worst slice in dB, or None.
        level: mean inside over the true one, or None.
    """

    what: str
    said: tuple[str, ...]
    psnr: float | None = None
    level: float | None = None


def main(options: Options) -> int:
    """Read the files, print the table, and return the exit status."""
    chosen = [case for case in cases() if options.only in case.truth]
    failures = 0
    for number, case in enumerate(chosen, 1):
        outcome = tried(case)
        failures += outcome.what != case.wanted
        print("\n".join(lines(number, case, outcome, options.width)), flush=True)
    print(f"{len(chosen)} files, {failures} not as they should be")
    return int(failures > 0)


def lines(number: int, case: Case, outcome: Outcome, width: int) -> list[str]:
    """What is printed of a file."""
    figures = ""
    if outcome.psnr is not None:
        figures = f", {outcome.psnr:.1f} dB, level {outcome.level:.3f}"
    mark = "" if outcome.what == case.wanted else f"   <-- wanted: {case.wanted}"
    options = " ".join(f"{name}={value}" for name, value in case.options.items())
    head = f"{number:2} {case.truth}{f' [{options}]' if options else ''}: {outcome.what}{figures}"
    said = [line for sentence in outcome.said for line in _wrapped(sentence, width)]
    return [head + mark, *(f"      {line}" for line in said)]


def _wrapped(sentence: str, width: int) -> list[str]:
    return textwrap.wrap(sentence, width) if width else [sentence]


def tried(case: Case) -> Outcome:
    """Open a file, reconstruct what it holds, and hold it against the truth."""
    from rift_cl import RiftError
    from rift_cl.commands.inputs.scan_input import ScanInput
    from rift_cl.commands.inputs.scan_rows import read_attenuation
    from rift_cl.reconstruct.direct.padding import is_truncated

    with tempfile.TemporaryDirectory(prefix="rift-cl-scans-") as folder:
        path = case.write(Path(folder))
        try:
            source = ScanInput(path, background=case.background, **case.options)
            scan = source.open_scan()
            stack = read_attenuation(scan, 0, scan.shape[1]).projections
        except RiftError as error:
            return Outcome(REFUSED, (str(error).replace(folder + "/", ""),))
        said = tuple(note.replace(folder + "/", "") for note in scan.notes)
        truth = case.scale * slices()[list(case.rows)]
        if stack.shape[1:] != (len(truth), BINS):
            return Outcome(WRONG, said)
        psnr, level = _scores(scan.angles, stack, truth)
    right = psnr >= _PSNR and abs(level - 1) <= _LEVEL and not is_truncated(stack)
    return Outcome(RIGHT if right else WRONG, said, psnr, level)


def _scores(angles: np.ndarray, stack: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """PSNR of the worst slice, and the mean inside over the true one."""
    import rift_cl as rift

    geometry = rift.Parallel(angles, BINS, 1.0, CENTER)
    projector = rift.Projector(rift.Grid((BINS, BINS), 1.0), geometry)
    rows = (np.ascontiguousarray(stack[:, row]) for row in range(len(truth)))
    images = np.stack([rift.fbp(projector, row) for row in rows])
    peak = truth.max()
    errors = np.square(images - truth).mean(axis=(1, 2))
    inside = truth > 0.2 * peak
    psnr = 10 * np.log10(peak**2 / errors.max())
    return float(psnr), float(images[inside].mean() / truth[inside].mean())


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
