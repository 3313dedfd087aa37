"""Arrays that a frame gives up while its last gradient is made, so that they are not in the way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from rift_cl.errors import GivenUpError


def give_up(owner: Any, *names: str) -> None:
    """Take arrays from a frozen dataclass, for good."""
    for name in names:
        object.__delattr__(owner, name)


class MayBeGivenUp:
    """A dataclass that says in a sentence that it has nothing any more."""

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Any]]

    def __repr__(self) -> str:
        """What there is; what was given up is named."""
        held = vars(self)
        fields = (
            f"{name}={held[name]!r}" if name in held else f"{name} given up"
            for name in type(self).__dataclass_fields__
        )
        return f"{type(self).__name__}({', '.join(fields)})"

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """What there is not: either it never was there, or it was given up."""
            owner = type(self)
            if not hasattr(owner, name) and name not in owner.__dataclass_fields__:
                raise AttributeError(f"{owner.__name__!r} object has no attribute {name!r}")
            raise GivenUpError(
                f"this {owner.__name__} has no {name} any more: a gradient with retain=False gave "
                "it up; read it before that, or leave retain as it is"
            )
