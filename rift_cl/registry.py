"""Things known by a name, which a user can add to without editing the package.

Filters, losses, angular bases and strategies are each one ``Registry``. Adding an entry holds for
the running process: import the module that adds it before its name is used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar

from rift_cl.errors import InputError, checked_flag

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries by name, in the order in which they were added.

    Args:
        kind: what an entry is, in the words of error messages: "strategy", say.
        entries: what the package comes with.
    """

    def __init__(self, kind: str, entries: Mapping[str, T]) -> None:
        self.kind = kind
        self._entries = dict(entries)
        self._ours = frozenset(entries)

    def __repr__(self) -> str:
        return f"<Registry of a {self.kind}: {', '.join(self)}>"

    def add(self, name: str, entry: T, *, replace: bool = False) -> None:
        """Add an entry.

        Args:
            name: of the entry.
            entry: what is known by it.
            replace: take the place of an entry of that name that was added before, as a cell of a
                notebook does that is run again.

        Raises:
            InputError: the name is empty, no text, or taken; or, with ``replace``, it is one of
                those that the package came with.
        """
        if not isinstance(name, str) or not name:
            raise InputError(f"the name of a {self.kind} is {name!r}, wanted a text")
        checked_flag(f"the {self.kind} {name!r}", "replace", replace)
        if name in self._ours & self._entries.keys() and replace:
            raise InputError(f"the {self.kind} {name!r} is the package's own: choose another name")
        if name in self._entries and not replace:
            raise InputError(
                f"a {self.kind} named {name!r} is registered already: choose another name, or "
                "register it with replace=True"
            )
        self._entries[name] = entry

    def remove(self, name: str) -> None:
        """Remove an entry.

        Raises:
            InputError: there is none of that name.
        """
        self[name]
        del self._entries[name]

    def __getitem__(self, name: str) -> T:
        """The entry of a name.

        Raises:
            InputError: there is none.
        """
        if not isinstance(name, str) or name not in self._entries:
            raise InputError(f"{self.kind} is {name!r}, wanted {self.wanted}")
        return self._entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        """The names."""
        return iter(tuple(self._entries))

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def names(self) -> tuple[str, ...]:
        """All names."""
        return tuple(self._entries)

    @property
    def wanted(self) -> str:
        """What a name has to be, for an error."""
        return (
            f"one of {', '.join(self)}, or one of yours that was registered (in a shell: "
            "rift --load FILE.py COMMAND)"
        )

    def name_of(self, entry: T) -> str:
        """The name of an entry.

        Raises:
            InputError: it was never registered.
        """
        for name, other in self._entries.items():
            if other is entry:
                return name
        raise InputError(f"{entry!r} is not registered as a {self.kind}")
