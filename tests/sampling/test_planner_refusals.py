"""Plans that cannot be made: which argument is wrong, and what leaves no place for a camera."""

import pytest
from test_planner import CENTER, LONG, TARGET

from rift_cl.errors import InputError
from rift_cl.sampling.planning.constraints import Budget, Constraints
from rift_cl.sampling.planning.keep_out import KeepOut, Sphere
from rift_cl.sampling.planning.planner import next_views, plan


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"views": 0}, "views is 0"),
        ({"views": 2.5}, "views is 2.5"),
        ({"views": "many"}, "views is 'many'"),
        ({"kind": "kriging"}, "kind is 'kriging'"),
        ({"method": "annealing"}, "method is 'annealing'"),
        ({"fixed": [1]}, "fixed holds 1"),
        (
            {"constraints": Constraints(keepouts=(KeepOut(Sphere(CENTER, 1e6)),))},
            r"keep-outs leave no place for a camera \(keepouts\[0\] takes 100%",
        ),
        (
            {"constraints": Constraints(keepouts=(KeepOut(Sphere(CENTER, 10), hides=True),))},
            r"keepouts\[0\] takes 100%",
        ),
        ({"constraints": Constraints(budget=Budget(0.5))}, "0.5 pays for no view: the cheapest"),
        (
            {"constraints": Constraints(budget=Budget(5, {"other": 1}))},
            r"per_view names .'other'.",
        ),
        ({"constraints": Constraints(distance=31), "cameras": (LONG,)}, "distance ends at 31"),
    ],
)
def test_what_cannot_be_planned_says_why(change, words):
    with pytest.raises(InputError, match=words):
        plan(**{"target": TARGET, "views": 4, **change})


def test_views_follow_on_others_only():
    with pytest.raises(InputError, match="no view"):
        next_views([], TARGET, 4)
