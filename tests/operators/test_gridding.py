"""The gridding kernel of the fast projector, and which rays are looked for in which tile."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Grid, Parallel
from rift_cl.operators.fourier.gridding import choose, kaiser_bessel, spectrum
from rift_cl.operators.projector.parallel.ray_geometry import fixed_steps, rays, tile_visits


def test_the_kernel_has_the_spectrum_that_is_divided_out():
    x = np.linspace(-3, 3, 200_001)
    values = kaiser_bessel(x, 6, 11.0)
    for frequency in (0.0, 0.2, 0.5, 1.3):
        sum_of_waves = np.trapezoid(values * np.cos(2 * np.pi * frequency * x), x)
        assert sum_of_waves == pytest.approx(
            float(spectrum(np.array(frequency), 6, 11.0)), abs=1e-4
        )


@pytest.mark.parametrize("error", [3e-2, 1e-3, 1e-5])
def test_the_kernel_that_is_chosen_is_good_enough(error):
    found = choose((300, 77), 10**5, error)
    assert found.error <= error
    assert found.edges[0] >= 300
    assert found.edges[1] >= 77
    assert all(edge % 8 == 0 for edge in found.edges)


@pytest.mark.parametrize(("tile", "pitch"), [(4, 0.7), (8, 0.3), (32, 0.11), (32, 3.0)])
def test_every_sample_is_met_by_the_visits_of_every_tile_it_reaches(pitch, tile):
    scan = Parallel(np.random.default_rng(1).uniform(-5, 5, 12), bins=90, pitch=pitch)
    found = rays(Grid((33, 40)), scan)
    edges, width, samples = (48, 56), 6, found.length // 2
    steps = fixed_steps(found, edges)
    visits, starts = tile_visits(steps, samples, edges, width, tile)
    across, down = -(-(edges[1] // 2 + 1) // tile), -(-edges[0] // tile)
    assert len(starts) == across * down + 1
    places = np.arange(1 - samples, samples)[:, None] * (steps[:, None, :] / 2.0**32)
    met = np.zeros((across * down, len(steps), places.shape[1]), np.intp)
    for number in range(across * down):
        for x, y, first, count in visits[starts[number] : starts[number + 1]]:
            ray = (first + np.arange(count)) % len(steps)
            inside = np.abs(places[ray] - (np.array([x, y]) + (tile - 1) / 2)) <= (tile + width) / 2
            met[number, ray] += inside.all(axis=2)
        x, y = number % across * tile, number // across * tile
        # The distance to a tile of the periodic grid, on either axis.
        period, middle = np.array([edges[1], edges[0]]), np.array([x, y]) + (tile - 1) / 2
        apart = np.abs((places - middle + period / 2) % period - period / 2)
        reached = (apart < (tile - 1 + width) / 2 - 1e-6).all(axis=2)
        assert (met[number][reached] >= 1).all()
