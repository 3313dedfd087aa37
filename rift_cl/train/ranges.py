"""Ranges of numbers in settings, and one sentence for whatever lies outside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rift_cl.errors import SettingError
from rift_cl.geometry.numbers import one_number
from rift_cl.registry import Registry

# Devices count in float32.
_LARGEST = 3.4028234e38
# What is counted here fits a long of any device.
_MOST = 2**62


def check_whole(settings: Any, name: str, least: int, most: int | None = None) -> None:
    """Check that a field is a whole number from ``least`` to ``most``, if there is one.

    Raises:
        SettingError: it is not.
    """
    given = getattr(settings, name)
    value = one_number(given)
    wanted = f"{least} to {most}"
    if most is None:
        most, wanted = _MOST, f"a whole number >= {least}"
        if value > most or (isinstance(given, int) and given > most):
            wanted = f"a whole number up to {most}"
    if not (least <= value <= most and value.is_integer()):
        raise SettingError(settings, name, f"is {given!r}, wanted {wanted}")


def check_number(settings: Any, name: str, *, most: float = _LARGEST, above: bool = False) -> None:
    """Check that a field is a number from 0 to ``most``; ``above`` leaves 0 itself out.

    Raises:
        SettingError: it is not.
    """
    given = getattr(settings, name)
    value = one_number(given)
    if not 0 <= value <= most or (above and value == 0):
        wanted = "a number > 0" if above else "a number >= 0"
        if most < _LARGEST:
            wanted = f"a number above 0, at most {most}" if above else f"0 to {most}"
        raise SettingError(settings, name, f"is {given!r}, wanted {wanted}")


def check_registered(settings: Any, name: str, registry: Registry[Any]) -> None:
    """Check that a field is a name in a registry.

    Raises:
        SettingError: it is not.
    """
    given = getattr(settings, name)
    if given not in registry:
        raise SettingError(settings, name, f"is {given!r}, wanted {registry.wanted}")


def check_choice(settings: Any, name: str, choices: Sequence[str]) -> None:
    """Check that a field is one of some words.

    Raises:
        SettingError: it is not.
    """
    given = getattr(settings, name)
    if given not in choices:
        wanted = " or ".join(choices)
        raise SettingError(settings, name, f"is {given!r}, wanted {wanted}")
