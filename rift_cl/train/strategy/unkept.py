"""What a strategy changes and no checkpoint holds: a resumed fit would begin with it anew.

A strategy of one's own that counts in a plain attribute works until its fit is taken up again,
which then gives other splats. So its attributes are compared with those that it began with.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.train.strategy.protocol import Strategy


class UnkeptAttributes:
    """Which attributes of a strategy change in a run.

    Those are compared that are plain: numbers, texts, None, arrays, and lists, tuples and dicts of
    these. Of others, such as arrays on a device, nothing is known.

    Args:
        strategy: one that begins.
    """

    def __init__(self, strategy: Strategy) -> None:
        self._strategy = strategy
        self._begun = _contents(strategy)

    def changed(self) -> list[str]:
        """Names of the attributes that are new or no longer what they were, sorted."""
        now = _contents(self._strategy)
        return sorted(name for name in now if now[name] != self._begun.get(name, _NOT_PLAIN))


_NOT_PLAIN = object()


def _contents(strategy: Strategy) -> dict[str, Any]:
    """The plain attributes, each as a copy that can be compared."""
    contents = {name: _content(value) for name, value in vars(strategy).items()}
    return {name: content for name, content in contents.items() if content is not _NOT_PLAIN}


def _content(value: Any) -> Any:
    """What a value holds, which compares as equal where nothing changed; ``_NOT_PLAIN``."""
    if value is None or isinstance(value, bool | int | float | complex | str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        kind = value.dtype
        return _NOT_PLAIN if kind.hasobject else (kind.str, value.shape, value.tobytes())
    if isinstance(value, dict):
        return _content(list(value.items()))
    if isinstance(value, list | tuple):
        parts = [_content(part) for part in value]
        return _NOT_PLAIN if any(part is _NOT_PLAIN for part in parts) else parts
    return _NOT_PLAIN
