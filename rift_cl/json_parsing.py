"""JSON that anyone may have written: whatever is wrong with it is a ``ValueError``.

``json.loads`` raises a RecursionError, which is none, where lists are nested some thousand deep; so
the package reads JSON by this alone (ruff's banned names hold it to that).
"""

from __future__ import annotations

import json
from typing import Any


def parse_json(text: str | bytes) -> Any:
    """The value that a JSON text holds.

    Raises:
        ValueError: it is no JSON, or nested too deeply to be read.
    """
    try:
        return json.loads(text)  # noqa: TID251 - the one place
    except RecursionError as error:
        raise ValueError("its lists or objects are nested too deeply") from error
