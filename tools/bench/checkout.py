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
_BENCH = "bench"


class Checkout:
    """A checkout of this repository, whose package is there while it is asked for.

    Args:
        folder: the checkout's root.
        bench: whether the checkout's ``tools/bench`` takes the place of this one's as well.
    """

    def __init__(self, folder: Path, *, bench: bool = False) -> None:
        root = folder.resolve()
        self._folders = [str(root), *([str(root / "tools")] if bench else [])]
        self._names = {_PACKAGE, *([_BENCH] if bench else [])}
        self._modules: dict[str, ModuleType] = {}

    @contextmanager
    def active(self) -> Iterator[Any]:
        """The package of the checkout, in the place of this one's: for its late imports, too."""
        ours = self._taken()
        sys.modules.update(self._modules)
        sys.path[:0] = self._folders
        try:
            package = import_module(_PACKAGE)
            if not str(package.__file__).startswith(self._folders[0]):
                raise ImportError(f"{self._folders[0]} has no package {_PACKAGE}")
            yield package
        finally:
            for folder in self._folders:
                sys.path.remove(folder)
            self._modules = self._taken()
            sys.modules.update(ours)

    def _taken(self) -> dict[str, ModuleType]:
        """The packages' modules, which are no longer there for an import."""
        names = [name for name in sys.modules if name.partition(".")[0] in self._names]
        return {name: sys.modules.pop(name) for name in names}
