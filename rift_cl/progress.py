"""What long work tells its caller between two steps.

The library prints nothing and draws no bar: everything that takes a while is a generator of
``Report`` records, and whoever runs it decides what to show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Report:
    """Where a piece of work stands.

    Args:
        done: steps that are finished.
        total: steps in all.
        what: what the steps are, in the plural, such as "slices".
        values: figures worth showing, by name.
        work: where steps do not cost the same: what was done and what there is in all, in any
            unit that is in proportion to the time that it takes.
    """

    done: int
    total: int
    what: str
    values: Mapping[str, float] = field(default_factory=dict)
    work: tuple[float, float] | None = None
