"""How fields of settings appear as options of the command line.

The settings of the trainer and the renderer are the options of ``rift fit`` themselves: a field is
an option, its type says what it takes, the text below it is its help. These marks say the rest.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

import tyro

T = TypeVar("T")
# Named without the name of the group that it is in: --steps, not --training.steps.
Short = Annotated[T, tyro.conf.arg(prefix_name=False)]
# Decided by the run where it is not given: its help says how, "None" would not.
Auto = Annotated[T | None, tyro.conf.arg(help_behavior_hint="")]
ShortAuto = Annotated[T | None, tyro.conf.arg(prefix_name=False, help_behavior_hint="")]
# No option: it follows from other settings, or has one value that makes sense.
NoOption = Annotated[T, tyro.conf.Fixed, tyro.conf.Suppress]
# Any number of values, none where it is not given.
Several = Annotated[tuple[T, ...], tyro.conf.arg(help_behavior_hint="")]
