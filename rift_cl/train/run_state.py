"""The state of a run as one level of named arrays, which is what a checkpoint holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

Group = Mapping[str, NDArray[Any]]


def flattened(groups: Mapping[str, Group]) -> dict[str, NDArray[Any]]:
    """Arrays of groups by the names of both, with a dot between."""
    return {f"{group}.{key}": array for group in groups for key, array in groups[group].items()}


def grouped(state: Group) -> dict[str, dict[str, NDArray[Any]]]:
    """Undoes ``flattened``."""
    groups: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in state.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = array
    return groups
