"""Packages that this one works with and does not depend on, loaded when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from rift_cl.errors import InputError


def optional_package(name: str, *, what: str) -> Any:
    """A package that may be missing; its objects are untyped here, installed or not.

    Args:
        name: as it is imported, which is what it is called on PyPI too.
        what: what needs it, for the sentence of the error.

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(
            f"{what} needs {name}, which cannot be loaded ({error}): pip install {name}"
        ) from error
