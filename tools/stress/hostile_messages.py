"""What a hostile or broken page may send to the viewer's server.

Every message that viser knows, with fields that are missing, of another type, huge, no numbers or
one too many; the panels of the page that is attacked, by their own names; and bytes that are no
message. Which message it is depends on the seed and its number alone.
"""

from __future__ import annotations

import dataclasses
import math
import random
from typing import Any

import msgspec

_HUGE = "x" * 100_000
_DEEP: list[Any] = []
for _ in range(200):
    _DEEP = [_DEEP]
HOSTILE: tuple[Any, ...] = (
    *(None, True, -1, 0, 2**63 - 1, -(2**63), 1e308, 1e-320, math.nan, math.inf, -math.inf),
    *(
        "",
        "../../../etc/passwd",
        "<script>alert(1)</script>",
        "\x00",
        "\x1b[2J",
        _HUGE,
        b"\x00" * 1000,
    ),
    *([], {}, _DEEP, [math.nan] * 4, [0.0] * 3, [1e308] * 4, [""] * 4, [0] * 100_000, {"": {}}),
)
# What makes a camera, so that some are nearly right.
_CAMERA = {
    "wxyz": [1.0, 0, 0, 0],
    "position": [0.0, 0, -4],
    "fov": 0.8,
    "near": 0.1,
    "far": 100.0,
    "image_height": 90,
    "image_width": 120,
    "look_at": [0.0, 0, 0],
    "up_direction": [0.0, 1, 0],
}


def message(kind: str, **fields: Any) -> bytes:
    """A message as a page sends it."""
    return msgspec.msgpack.encode({"type": kind, **fields})


def camera(**changed: Any) -> bytes:
    """What a page says of its camera."""
    return message("ViewerCameraMessage", **_CAMERA | changed)


def kinds() -> dict[str, list[str]]:
    """The fields of every message that viser knows, by its name."""
    from viser import _messages
    from viser.infra import Message

    known = (each for each in vars(_messages).values() if isinstance(each, type))
    found = [each for each in known if issubclass(each, Message) and dataclasses.is_dataclass(each)]
    return {each.__name__: [field.name for field in dataclasses.fields(each)] for each in found}


def hostile(known: dict[str, list[str]], panels: list[str], seed: int, number: int) -> bytes | str:
    """Message number so and so.

    Args:
        known: the fields of every message.
        panels: names of what the page has to press, pull and fill in.
        seed: of the choice.
        number: of the message.
    """
    draw = random.Random(f"{seed} {number}")
    way = draw.random()
    if way < 0.3:
        return camera(**{draw.choice(list(_CAMERA)): draw.choice(HOSTILE)})
    if way < 0.6 and panels:
        given = {"uuid": draw.choice(panels), "updates": {"value": draw.choice(HOSTILE)}}
        if draw.random() < 0.2:
            given["updates"] = {draw.choice(("visible", "label", "no such", "order")): True}
        return message("GuiUpdateMessage", **given)
    if way < 0.95:
        kind = draw.choice(sorted(known))
        fields = {name: draw.choice(HOSTILE) for name in known[kind] if draw.random() < 0.9}
        if panels:
            fields |= {name: draw.choice(panels) for name in known[kind] if "uuid" in name}
        return message(kind, **fields)
    if way < 0.97:
        return draw.choice(("", "words", _HUGE))
    whole = camera()
    return (
        draw.randbytes(draw.randrange(200)) if way < 0.985 else whole[: draw.randrange(len(whole))]
    )
