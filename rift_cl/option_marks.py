"""How fields of settings appear as options of the command line.

The settings of the trainer and the renderer are the options of ``rift fit`` themselves: a field is
an option, its type says what it takes, the text below it is its help. These marks say the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeVar

import tyro

T = TypeVar("T")


@dataclass(frozen=True)
class Group:
    """A group of options in a command's help, in which a setting or a part of them is listed.

    Args:
        title: what it is called.
        about: one sentence about it.
    """

    title: str
    about: str


# Named without the name of the group that it is in: --steps, not --training.steps.
Short = Annotated[T, tyro.conf.arg(prefix_name=False)]
# Decided by the run where it is not given: its help says how, "None" would not.
Auto = Annotated[T | None, tyro.conf.arg(help_behavior_hint="")]
ShortAuto = Annotated[T | None, tyro.conf.arg(prefix_name=False, help_behavior_hint="")]
# No option: it follows from other settings, or has one value that makes sense.
NoOption = Annotated[T, tyro.conf.Fixed, tyro.conf.Suppress]
# Listed apart from what a run usually needs.
EXPERT = Group("expert", "For experts: few runs need another value of these.")
Expert = Annotated[T, EXPERT]
ShortExpert = Annotated[T, tyro.conf.arg(prefix_name=False), EXPERT]
AutoExpert = Annotated[T | None, tyro.conf.arg(help_behavior_hint=""), EXPERT]
# Listed with what the splats are.
SPLATS = Group("splats", "What the splats are and how they are drawn.")
ShortSplats = Annotated[T, tyro.conf.arg(prefix_name=False), SPLATS]
# Listed with how the command runs.
RUN = Group("run", "How the command runs.")
# Any number of values, none where it is not given.
Several = Annotated[tuple[T, ...], tyro.conf.arg(help_behavior_hint="")]
