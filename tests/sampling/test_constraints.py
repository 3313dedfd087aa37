"""Limits of views: what is impossible says so, what is possible fits every camera type."""

import math

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.sampling.planning.constraints import Budget, Constraints, Ranges
from rift_cl.sampling.planning.design_space import DISTANCE, FOCAL, DesignSpace, default_types
from rift_cl.sampling.planning.paths import Spline, TiltedRings
from rift_cl.sampling.targets.target import Target

TARGET = Target((1, 2, 3), 10.0)
LENS = CameraType("lens", 5.0, 8.0, 0.01, (300, 400))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Constraints(elevation=(0.5, 0.2)), "an empty range"),
        (lambda: Constraints(elevation=(0, 60)), "were these degrees"),
        (lambda: Constraints(azimuth=(0, 120)), "were these degrees"),
        (lambda: Constraints(azimuth=(1, math.nan)), "azimuth is"),
        (lambda: Constraints(distance=0), "distance is 0"),
        (lambda: Constraints(distance=(5, 2)), "an empty range"),
        (lambda: Constraints(cover=0), "cover is 0"),
        (lambda: Constraints(cover=1.5), "cover is 1.5"),
        (lambda: Constraints(up=(0, 0, 0)), "up is"),
        (lambda: Constraints(path="ring"), "path is 'ring'"),
        (lambda: Constraints(keepouts=(1,)), r"keepouts\[0\] is 1"),
        (lambda: Constraints(budget=20), "budget is 20"),
        (lambda: Constraints(ranges={"lens": (1, 2)}), r"ranges\['lens'\]"),
        (lambda: Constraints(path=TiltedRings(), azimuth=(0, 1)), "all the way round"),
        (lambda: Ranges(focal_length=(0, 5)), "focal_length is"),
        (lambda: Ranges(f_number=(8, 4)), "an empty range"),
        (lambda: Budget(0), "total is 0"),
        (lambda: Budget(5, per_view=-1), "per_view is -1"),
        (lambda: Budget(5, {"lens": 0}), "cost nothing"),
        (lambda: TiltedRings(0), "count is 0"),
        (lambda: Spline(3), "controls is 3"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    ("limits", "types", "words"),
    [
        (Constraints(distance=(5, 6)), (LENS,), "distance ends at 6"),
        (Constraints(), (LENS, LENS), "a name of its own"),
        (Constraints(ranges={"zoom": Ranges()}), (LENS,), "no camera's name"),
        (Constraints(), ("lens",), "wanted a CameraType"),
    ],
)
def test_a_camera_that_cannot_be_used_is_named(limits, types, words):
    with pytest.raises(InputError, match=words):
        DesignSpace(TARGET, limits, types)


@pytest.mark.parametrize("cover", [1.0, 0.6, 0.2])
def test_the_nearest_place_has_just_so_much_of_the_target_in_the_picture(cover):
    design = DesignSpace(TARGET, Constraints(cover=cover), (LENS,))
    near, far = design.limits[0, DISTANCE]
    assert near == far
    # The outline of the ball: a disc in the picture, counted point by point.
    radius = TARGET.diameter / 2 / math.sqrt(near**2 - TARGET.diameter**2 / 4)
    radius *= LENS.image_distance(near) / LENS.pixel
    line = (np.arange(400) + 0.5) / 200 - 1
    x, y = np.meshgrid(line * radius, line * radius)
    disc = np.hypot(x, y) < radius
    share = (disc & (np.abs(x) < 200) & (np.abs(y) < 150)).sum() / disc.sum()
    assert share == pytest.approx(cover, abs=0.01)


def test_a_zoom_lens_may_be_as_long_as_the_target_still_fits():
    limits = Constraints(distance=(1, 200), ranges={"lens": Ranges((2, 90))})
    design = DesignSpace(TARGET, limits, (LENS,))
    assert design.limits[0, DISTANCE, 1] == 200
    for distance in (design.limits[0, DISTANCE, 0], 50.0, 150.0):
        longest, by_distance, by_focus = design.longest(0, np.array(distance), np.array(0.5))
        zoomed = design.type_at(0, [0, 0, distance, float(longest), 8, 0, 1])
        tangent = 5 / math.sqrt(distance**2 - 25)
        wide = tangent * zoomed.image_distance(distance + 0.5) / zoomed.pixel
        assert wide == pytest.approx(150)
        for slope, step in ((by_distance, (1e-4, 0)), (by_focus, (0, 1e-4))):
            ends = [
                design.longest(
                    0, np.array(distance + sign * step[0]), np.array(0.5 + sign * step[1])
                )
                for sign in (1, -1)
            ]
            assert slope == pytest.approx((ends[0][0] - ends[1][0]) / 2e-4, rel=1e-5)
    # At the nearest place, the shortest focal length is the longest that fits.
    near = design.limits[0, DISTANCE, 0]
    assert design.longest(0, np.array(near), np.array(0.0))[0] == pytest.approx(
        design.limits[0, FOCAL, 0], rel=1e-6
    )


def test_who_names_no_camera_gets_one_that_passes_the_whole_band():
    (kind,) = default_types(TARGET)
    near = DesignSpace(TARGET, Constraints(), (kind,)).limits[0, DISTANCE, 0]
    assert TARGET.highest * kind.pixel * near / kind.image_distance(near) < 0.05


def test_up_is_where_elevation_points():
    for up in ((0, 0, 1), (0, -2, 0), (1, 0, 0), (1, 2, 3)):
        axes = Constraints(up=up).axes
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        np.testing.assert_allclose(axes[2], np.array(up) / np.linalg.norm(up))
