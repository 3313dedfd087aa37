"""Whether splats share an environment light, and what they keep for themselves beside it.

What a splat shows of one circle of views says little of the views above and below it. A light that
all splats reflect, each by its normal, has been seen from wherever any of them looks: it is what
extrapolates, and the less splats may do on their own, the more of it is found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from tyro.conf import arg

from rift_cl.basis.angular.environment import MOST_LOBES, REFLECTANCE
from rift_cl.option_marks import Short
from rift_cl.train.ranges import check_choice, check_whole

EnvironmentKind = Literal["none", "shared"]


@dataclass(frozen=True)
class EnvironmentSettings:
    """An environment light that all splats share.

    Raises:
        InputError: a number is out of its range, or the kind is unknown.
    """

    kind: Annotated[EnvironmentKind, arg(name="environment", prefix_name=False)] = "none"
    """Light from far away: none, or one that all splats share and reflect about their normals
    (shared), each with its tint, its tint at grazing angles and its sharpness; for glossy subjects
    and views that leave the photographed orbit. The fit writes it as a picture, environment.exr."""
    lobes: Annotated[int, arg(name="environment-lobes", prefix_name=False)] = 128
    """Number of lobes of a shared light, spread evenly over all directions, 8 to 4096."""
    own_degree: Short[int] = 1
    """Highest degree of the harmonics of splats' own colours beside a shared light, 0 to 4, in
    place of --sh-degree."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_choice(self, "kind", get_args(EnvironmentKind))
        check_whole(self, "lobes", 8, MOST_LOBES)
        check_whole(self, "own_degree", 0, 4)

    @property
    def shared(self) -> bool:
        """Whether there is such a light."""
        return self.kind == "shared"

    @property
    def numbers(self) -> int:
        """What a splat takes to reflect it: a normal and a reflectance."""
        return 3 + REFLECTANCE if self.shared else 0
