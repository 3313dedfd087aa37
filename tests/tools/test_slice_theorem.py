"""The slice theorem: on phantoms to 1e-3, and on Gaussians against their closed form."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import phantom
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Grid

FLAT = Grid((96, 110), (1.1, 1.0), (3.0, -7.0))
SOLID = Grid((26, 30, 28), (1.0, 0.9, 1.1), (1.0, 2.0, -3.0))


@pytest.fixture
def theorem(tool):
    return tool("paper.slice_theorem")


def gaussian(grid, center, spread):
    axes = np.meshgrid(*(grid.coordinates(a) for a in range(len(grid.shape))), indexing="ij")
    square = sum(((x - c) / s) ** 2 for x, c, s in zip(axes, center, spread, strict=True))
    return np.exp(-square / 2)


def gaussian_spectrum(k, center, spread):
    """The product of s sqrt(2 pi) exp(-2 (pi s k)^2), turned by the place."""
    spread, center = np.array(spread), np.array(center)
    height = np.prod(spread * np.sqrt(2 * np.pi)) * np.exp(-2 * ((np.pi * spread * k) ** 2).sum(1))
    return height * np.exp(-2j * np.pi * k @ center)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 1.2, 2.5])
def test_an_image_of_the_head(theorem, device, angle):
    assert (
        theorem.slice_comparison(phantom.shepp_logan(FLAT), FLAT, angle, device=device).error < 1e-3
    )


@pytest.mark.parametrize("angle", [0.4, 1.3])
def test_a_volume_of_the_head_seen_across_z(theorem, device, angle):
    volume = phantom.shepp_logan(SOLID)
    assert theorem.slice_comparison(volume, SOLID, angle, device=device).error < 1e-3


@pytest.mark.parametrize("line", [(0, 0, 1), (1, 0, 0), (1, 2, 3), (0.3, -0.5, 0.2)])
def test_a_volume_of_the_head_seen_along_any_line(theorem, line):
    comparison = theorem.slice_comparison(phantom.shepp_logan(SOLID), SOLID, line)
    assert comparison.error < 1e-3
    across = comparison.frequencies[:, ::-1] @ np.array(line)
    assert np.abs(across).max() < 1e-12


@pytest.mark.parametrize(
    ("grid", "center", "spread", "direction"),
    [
        (FLAT, (10.0, -12.0), (3.0, 6.0), 0.7),
        (SOLID, (1.5, 3.0, -3.0), (2.2, 3.0, 2.6), 0.9),
        (SOLID, (1.5, 3.0, -3.0), (2.2, 2.4, 2.6), (0.5, 0.1, 0.8)),
    ],
)
def test_a_gaussian_has_its_closed_form(theorem, device, grid, center, spread, direction):
    values = gaussian(grid, center, spread)
    found = theorem.slice_comparison(values, grid, direction, device=device)
    assert found.error < 1e-3
    exact = gaussian_spectrum(found.frequencies, center, spread)
    weight = np.linalg.norm(found.frequencies, axis=1)
    # The pixel's and the bin's own transform is all that stands between.
    response = found.slice / theorem.transform(values, grid, found.frequencies)
    off = np.abs(found.projection - response * exact) * weight
    assert off.max() < 1e-3 * (np.abs(exact) * weight).max()


def test_another_object_is_not_the_same(theorem):
    """A share of what is wrong shows: one pixel in the phantom's background."""
    image = phantom.shepp_logan(FLAT)
    right = theorem.slice_comparison(image, FLAT, 0.3)
    image[40, 20] += 0.5
    wrong = theorem.slice_comparison(image, FLAT, 0.3)
    mixed = type(right)(right.frequencies, wrong.projection, right.slice)
    assert mixed.error > 5e-3


def test_an_object_of_nothing_is_refused(theorem):
    with pytest.raises(InputError, match="zero everywhere"):
        theorem.slice_comparison(np.zeros(FLAT.shape), FLAT, 0.3)


def test_bad_arguments_are_refused(theorem):
    image = np.ones(FLAT.shape)
    with pytest.raises(ShapeError, match="the grid has"):
        theorem.slice_comparison(image[1:], FLAT, 0.0)
    with pytest.raises(InputError, match="NaN"):
        theorem.slice_comparison(image * np.nan, FLAT, 0.0)
    with pytest.raises(InputError, match="band"):
        theorem.slice_comparison(image, FLAT, 0.0, band=0.7)
    with pytest.raises(ShapeError, match="for a volume a vector"):
        theorem.slice_comparison(image, FLAT, (1, 0, 0))
    with pytest.raises(InputError, match="not zero"):
        theorem.slice_comparison(np.ones(SOLID.shape), SOLID, (0, 0, 0))
    with pytest.raises(InputError, match="angle"):
        theorem.slice_comparison(image, FLAT, np.nan)
