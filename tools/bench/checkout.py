"""Another version of the package in the same process, so that two can take turns."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

_PACKAGE = "rift_cl"


class Checkout:
    """A checkout of this repository, whose package is there while it is asked for.

    Args:
        folder: the checkout's root.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = str(folder.resolve())
        self._modules: dict[str, ModuleType] = {}

    @contextmanager
    def active(self) -> Iterator[Any]:
        """The package of the checkout, in the place of this one's: for its late imports, too."""
        ours = _taken()
        sys.modules.update(self._modules)
        sys.path.insert(0, self._folder)
        try:
            package = import_module(_PACKAGE)
            if not str(package.__file__).startswith(self._folder):
                raise ImportError(f"{self._folder} has no package {_PACKAGE}")
            yield package
        finally:
            sys.path.remove(self._folder)
            self._modules = _taken()
            sys.modules.update(ours)


def _taken() -> dict[str, ModuleType]:
    """The package's modules, which are no longer there for an import."""
    names = [name for name in sys.modules if name.partition(".")[0] == _PACKAGE]
    return {name: sys.modules.pop(name) for name in names}
