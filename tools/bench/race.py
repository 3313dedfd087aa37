"""Whole operations, ours and the peers' in turns, and how good their results are.

A round runs every contender once (ours a few times, being short), so that whatever else the
machine does falls on all of them alike.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Case, Floats
from bench.contender import Contender
from bench.timing import summary, timed
from rift_cl import metrics

# The adjoint test runs both directions twice more; beyond this many updates it would take minutes.
_ADJOINT_UPDATES = 1e9
# Noise must vanish where scikit-image, whose disc is half a pixel off, wants zeros.
_MARGIN = 2.0


@dataclass
class Entry:
    """One contender's times and last results.

    Args:
        contender: who.
        seconds: the times of each operation.
        outputs: the last result of each operation, in our conventions.
    """

    contender: Contender
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    outputs: dict[str, Floats] = field(default_factory=dict)


def line_up(
    kinds: Iterable[type[Contender]], device: rift.Device, case: Case, skipped: dict[str, str]
) -> list[Contender]:
    """Make the contenders of a case; who cannot be made is left out and the reason noted."""
    contenders = []
    for kind in kinds:
        if kind.name in skipped:
            continue
        try:
            contenders.append(kind(device, case))
        except Exception as error:
            if kind.ours:
                raise
            skipped[kind.name] = _reason(error)
    return contenders


def race(
    contenders: Sequence[Contender], *, rounds: int, warm_up: bool, skipped: dict[str, str]
) -> list[Entry]:
    """Time every contender's operations in turns.

    Args:
        contenders: who takes part.
        rounds: how often each has its turn.
        warm_up: whether peers run once before anything counts; we always do.
        skipped: where a peer that fails is noted with its reason; it drops out.
    """
    entries = [Entry(contender) for contender in contenders]
    for entry in entries:
        if warm_up or entry.contender.ours:
            _turn(entry, skipped)
            entry.seconds.clear()
    for _ in range(rounds):
        for entry in entries:
            _turn(entry, skipped)
    return [entry for entry in entries if entry.contender.name not in skipped]


def _turn(entry: Entry, skipped: dict[str, str]) -> None:
    contender = entry.contender
    if contender.name in skipped:
        return
    try:
        for operation in contender.operations:
            _repeat(entry, operation)
    except Exception as error:
        if contender.ours:
            raise
        skipped[contender.name] = _reason(error)


def _repeat(entry: Entry, operation: str) -> None:
    contender = entry.contender
    given = contender.case.image if operation == "forward" else contender.sinogram
    array, run = contender.enter(given), getattr(contender, operation)
    for _ in range(contender.repeats):
        seconds, result = timed(lambda: run(array))
        entry.seconds[operation].append(seconds)
    # A copy: some peers hand out the same buffer every time.
    entry.outputs[operation] = np.array(contender.leave(result))


def _reason(error: Exception) -> str:
    text = str(error).strip() or "no message"
    return f"{type(error).__name__}: {text.splitlines()[0]}"


def race_record(entry: Entry, *, seed: int) -> dict[str, Any]:
    """The JSON record of one contender at one size."""
    contender, case = entry.contender, entry.contender.case
    return {
        "name": contender.name,
        "arrays": contender.arrays,
        "ours": contender.ours,
        "operations": {
            operation: {**summary(seconds), "updates_per_s": case.updates / min(seconds)}
            for operation, seconds in entry.seconds.items()
        },
        "accuracy": _accuracy(entry, seed=seed),
    }


def _accuracy(entry: Entry, *, seed: int) -> dict[str, float | None]:
    """Scores of the last results; of the first slice, since a stack's are all alike."""
    contender, case, mask = entry.contender, entry.contender.case, entry.contender.case.disc()
    found = entry.outputs.get("fbp")
    image = None if found is None else found.reshape(-1, case.n, case.n)[0]
    test = case.slices == 1 and case.updates <= _ADJOINT_UPDATES
    return {
        "forward_error": _relative(entry.outputs["forward"], contender.sinogram),
        "fbp_psnr_db": None if image is None else metrics.psnr(image, case.truth, mask=mask),
        "fbp_ssim": None if image is None else metrics.ssim(image, case.truth, mask=mask),
        "adjoint_mismatch": adjoint_mismatch(contender, seed=seed) if test else None,
    }


def _relative(found: Floats, exact: Floats) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def adjoint_mismatch(contender: Contender, *, seed: int) -> float:
    """|<Ax, y> - s <x, A'y>| / (|Ax| |y|) for white noise x in the disc and y = Ax.

    Packages scale their backprojection differently, so the factor s is fitted first, on the
    phantom and its projection.
    """
    case = contender.case
    image, views, back = _there_and_back(contender, case.truth)
    scale = np.sum(views**2) / np.sum(image * back)
    noise = np.random.default_rng(seed).standard_normal(case.truth.shape).astype(np.float32)
    image, views, back = _there_and_back(contender, noise * case.disc(margin=_MARGIN))
    energy = np.sum(views**2)
    return float(abs(energy - scale * np.sum(image * back)) / energy)


def _there_and_back(contender: Contender, image: Floats) -> tuple[Any, Any, Any]:
    views = np.array(contender.leave(contender.forward(contender.enter(image))), dtype=np.float32)
    back = contender.leave(contender.backward(contender.enter(views)))
    return image.astype(np.float64), views.astype(np.float64), back.astype(np.float64)


def speed_ups(records: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many times faster we are than the fastest peer, by minimum and by median."""
    rivals = [record for record in records if not record["ours"]]
    found = []
    for ours in (record for record in records if record["ours"]):
        for operation in ours["operations"]:
            able = [rival for rival in rivals if operation in rival["operations"]]
            if able:
                found.append(_speed_up(operation, ours, able))
    return found


def _speed_up(operation: str, ours: dict[str, Any], rivals: list[dict[str, Any]]) -> dict[str, Any]:
    fastest = min(rivals, key=lambda rival: float(rival["operations"][operation]["min_s"]))
    mine, theirs = ours["operations"][operation], fastest["operations"][operation]
    return {
        "operation": operation,
        "ours": ours["name"],
        "peer": fastest["name"],
        "by_min": theirs["min_s"] / mine["min_s"],
        "by_median": theirs["median_s"] / mine["median_s"],
    }
