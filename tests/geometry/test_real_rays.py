"""Rays by Snell's law: against another program, exact surfaces, and the limit of small heights."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics import real_rays
from rift_cl.optics.gaussian_lens import gaussian_lens
from rift_cl.optics.glass import Glass
from rift_cl.optics.lens_prescription import LensPrescription, Surface
from rift_cl.optics.real_rays import chief_ray, pupil_rays, trace
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens

# optiland 0.6.3, trace_generic on the axis: height in the prescribed image plane and direction
# cosine of the rays at half of the pupil and at its edge.
PEERS = {
    "cooke_triplet": ((0.006286457711245, -0.004195677081326), (-0.050075481501, -0.100437974569)),
    "double_gauss": ((-0.002406107776080, -0.018003288506502), (-0.050019972898, -0.100148242673)),
}
GLASS = Glass("g", "constant", (1.5,))


@pytest.mark.parametrize("name", PEERS)
def test_real_rays_land_where_another_program_has_them(name: str) -> None:
    lens = open_lens(stock_lens(name))
    rays = pupil_rays(gaussian_lens(lens), [[0, 0.5], [0, 1]])
    last = trace(lens, rays)[-1]
    heights = last.at(lens.length + lens.image_distance)[:, 1]
    np.testing.assert_allclose(heights, PEERS[name][0], atol=1e-9)
    np.testing.assert_allclose(last.direction[:, 1], PEERS[name][1], atol=1e-9)


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_rays_close_to_the_axis_are_paraxial(name: str) -> None:
    """The error falls with the square of the height: spherical aberration is of third order."""
    lens = open_lens(stock_lens(name))
    gaussian = gaussian_lens(lens)
    for distance in (math.inf, 30 * gaussian.focal_length):
        image = lens.length + gaussian.image_position(distance)
        heights = np.array([0.02, 0.04])
        rays = pupil_rays(gaussian, np.stack([0 * heights, heights], 1), distance=distance)
        last = trace(lens, rays)[-1]
        slope = last.direction[:, 1] / last.direction[:, 2]
        off = last.at(image)[:, 1] / slope
        assert np.abs(off).max() < 2e-3 * gaussian.focal_length
        assert off[1] / off[0] == pytest.approx(4, rel=0.05)


def test_a_hyperbola_focuses_parallel_light_and_an_ellipse_does() -> None:
    """Without spherical aberration: the conic is -n^2 leaving glass, -1 / n^2 entering."""
    leaving = LensPrescription(
        "hyperbola", (Surface(math.inf, 5.0, GLASS), Surface(-20.0, 0.0, conic=-2.25)), 0, 20.0
    )
    image = leaving.length + gaussian_lens(leaving).rear_focus
    rays = pupil_rays(gaussian_lens(leaving), [[0, 0.3], [0.5, 0.5], [0, 1]])
    np.testing.assert_allclose(trace(leaving, rays)[-1].at(image), 0, atol=1e-12)
    # Inside the glass behind an ellipse, at n R / (n - 1).
    entering = LensPrescription(
        "ellipse",
        (Surface(20.0, 30.0, GLASS, conic=-1 / 2.25), Surface(math.inf, 0.0)),
        0,
        20.0,
    )
    inside = trace(entering, pupil_rays(gaussian_lens(entering), [[0, 0.5], [0.6, 0.8]]))[0]
    np.testing.assert_allclose(inside.at(1.5 * 20 / 0.5), 0, atol=1e-12)


def test_every_ray_obeys_snell_and_stays_in_its_plane() -> None:
    lens = open_lens(stock_lens("singlet"))
    rays = pupil_rays(gaussian_lens(lens), [[0.3, 0.4], [0, 0.9]], distance=100.0, slope=0.1)
    first = trace(lens, rays)[0]
    n, radius = lens.indices(lens.wavelength)[1], lens.surfaces[0].radius
    normal = ([0, 0, radius] - first.position) / radius
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=1e-12)
    before, after = np.cross(normal, rays.direction), np.cross(normal, first.direction)
    np.testing.assert_allclose(before, n * after, atol=1e-12)


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_the_chief_ray_goes_through_the_middle_of_the_stop(name: str) -> None:
    lens = open_lens(stock_lens(name))
    gaussian = gaussian_lens(lens)
    found = chief_ray(lens, gaussian, 0.15)
    stop = sum(surface.thickness for surface in lens.surfaces[: lens.stop])
    if lens.stop:
        assert abs(found[lens.stop - 1].at(stop)[0, 1]) < 1e-9
    # A point above the axis, seen upside down: it lands close to f tan, with the sign of its ray.
    image = lens.length + gaussian.image_position(math.inf)
    height = found[-1].at(image)[0, 1]
    assert height == pytest.approx(-gaussian.focal_length * 0.15, rel=0.02)


def test_rays_that_miss_or_cannot_leave_name_the_surface() -> None:
    ball = LensPrescription("ball", (Surface(5.0, 10.0, GLASS), Surface(-5.0, 0.0)), 0, 12.0)
    with pytest.raises(InputError, match="misses surface 1 of 2"):
        trace(ball, pupil_rays(gaussian_lens(ball), [[0, 1]]))
    steep = LensPrescription("steep", (Surface(math.inf, 10.0, GLASS), Surface(-5.0, 0.0)), 0, 9.0)
    with pytest.raises(InputError, match="surface 2 of 2"):
        trace(steep, pupil_rays(gaussian_lens(steep), [[0, 1]]))
    for bad in (0.0, math.nan, "far"):
        with pytest.raises(InputError, match="distance"):
            pupil_rays(gaussian_lens(steep), [[0, 1]], distance=bad)  # type: ignore[arg-type]


def test_a_chief_ray_that_is_not_found_is_no_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    """Secant steps that end somewhere else must not pass for the middle of the stop."""
    lens = open_lens(stock_lens("cooke_triplet"))

    def never_there(lens: LensPrescription, rays: real_rays.Rays) -> list[real_rays.Rays]:
        place, straight = rays.position.copy(), np.array([[0.0, 0.0, 1.0]])
        place[:, 1] = 1 + place[:, 1] ** 2
        return [real_rays.Rays(place, straight) for _ in lens.surfaces]

    monkeypatch.setattr(real_rays, "trace", never_there)
    with pytest.raises(InputError, match="the stop"):
        chief_ray(lens, gaussian_lens(lens), 0.15)
