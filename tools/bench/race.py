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
from bench.case import Floats
from bench.contender import Contender, LeftOutError
from bench.timing import summary, timed


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
    kinds: Iterable[type[Contender]], device: rift.Device, case: Any, skipped: dict[str, str]
) -> list[Contender]:
    """Make the contenders of a case; who cannot be made is left out and the reason noted."""
    contenders = []
    for kind in kinds:
        if kind.name in skipped:
            continue
        try:
            contenders.append(kind(device, case))
        except Exception as error:
            if kind.ours and not isinstance(error, LeftOutError):
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


def compared(
    kinds: Iterable[type[Contender]],
    device: rift.Device,
    case: Any,
    *,
    rounds: int,
    warm_up: bool = True,
    seed: int,
    skipped: dict[str, str],
) -> dict[str, Any]:
    """The JSON record of a race between those who can be made: each of them, and our lead."""
    entries = race(
        line_up(kinds, device, case, skipped), rounds=rounds, warm_up=warm_up, skipped=skipped
    )
    records = [race_record(entry, seed=seed) for entry in entries]
    return {"contenders": records, "speed_ups": speed_ups(records)}


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
    run = contender.prepared(operation)
    for _ in range(contender.repeats):
        seconds, result = timed(run)
        entry.seconds[operation].append(seconds)
    # A copy: some peers hand out the same buffer every time.
    entry.outputs[operation] = np.array(contender.leave(result))


def _reason(error: Exception) -> str:
    text = str(error).strip() or "no message"
    return f"{type(error).__name__}: {text.splitlines()[0]}"


def race_record(entry: Entry, *, seed: int) -> dict[str, Any]:
    """The JSON record of one contender at one size."""
    contender = entry.contender
    return {
        "name": contender.name,
        "arrays": contender.arrays,
        "ours": contender.ours,
        "operations": {
            operation: {**summary(seconds), **contender.rates(min(seconds))}
            for operation, seconds in entry.seconds.items()
        },
        "accuracy": contender.accuracy(entry.outputs, seed=seed),
    }


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
