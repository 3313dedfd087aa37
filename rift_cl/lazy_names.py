"""Public names of packages that are imported when they are first used (PEP 562).

A package that offers much is imported for little: settings of a command, say, for its help. Its
``__init__`` lists its names for type checkers, and here says where each of them comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, names: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The functions ``__getattr__`` and ``__dir__`` of a package.

    Args:
        package: its ``__name__``.
        names: public names by the module within the package that defines them; "" lists modules.
    """
    homes = {name: home for home, names_there in names.items() for name in names_there}

    def lookup(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not homes[name]:
            return import_module(f"{package}.{name}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return lookup, lambda: sorted(homes)
