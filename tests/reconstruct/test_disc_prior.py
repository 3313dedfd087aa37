"""A disc is found from its edges, its material from its rim, and what is no disc is refused."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Grid, Parallel
from rift_cl.errors import InputError, ShapeError
from rift_cl.reconstruct import Disc, find_disc, material_lengths

RANDOM = np.random.default_rng(9)


def scan_of(degrees, bins=200, **given):
    return Parallel(np.deg2rad(np.arange(0, degrees, max(degrees / 31, 0.5))) + 0.4, bins, **given)


def lengths(scan, disc, holes):
    """Exact lengths of material of a disc with round holes."""
    return disc.chords(scan) - sum(Disc(*hole).chords(scan) for hole in holes)


HOLES = [(10.0, -20.0, 15.0), (-25.0, 22.0, 18.0), (30.0, 25.0, 11.0)]


@pytest.mark.parametrize("degrees", [30, 180, 360])
@pytest.mark.parametrize(("bins", "scale"), [(200, 1.0), (90, 0.4), (700, 3.0)])
def test_a_disc_is_found_to_a_fraction_of_a_bin(degrees, bins, scale):
    disc = Disc(3.1 * scale, -4.2 * scale, 80.0 * scale)
    scan = scan_of(degrees, bins, pitch=scale * 200 / bins, center=0.53 * bins)
    exact = lengths(scan, disc, [tuple(scale * n for n in hole) for hole in HOLES])
    values = 0.02 / scale * exact + 0.015 + 0.004 * RANDOM.standard_normal(exact.shape)
    found = find_disc(values, scan)
    # The centre's coordinate along the rays is known from how the shadow moves alone.
    loose = 0.4 if degrees == 30 else 0.12
    assert abs(found.x - disc.x) < loose * scan.pitch and abs(found.y - disc.y) < loose * scan.pitch
    assert abs(found.radius - disc.radius) < 0.15 * scan.pitch
    assert found.misfit < 0.3 * scan.pitch


def test_rays_that_were_not_seen_are_not_looked_at():
    disc, scan = Disc(3.0, -4.0, 80.0), scan_of(30)
    exact = lengths(scan, disc, HOLES)
    seen = np.ones(exact.shape, bool)
    for k in range(0, len(seen), 2):
        seen[k, : 100 + k] = False
    given = np.where(seen, 0.02 * exact, np.nan)
    found = find_disc(given, scan, seen=seen)
    assert abs(found.radius - 80) < 0.2 and np.hypot(found.x - 3, found.y + 4) < 0.4
    material = material_lengths(given, scan, found, seen=seen)
    np.testing.assert_allclose(material.lengths[seen], exact[seen], atol=0.8)
    assert (material.lengths[~seen] == 0).all()


def test_a_hardened_beam_and_an_offset_are_undone():
    disc, scan = Disc(0.0, 2.0, 80.0), scan_of(30)
    exact = lengths(scan, disc, HOLES)
    hardened = -np.log(0.6 * np.exp(-0.011 * exact) + 0.4 * np.exp(-0.028 * exact)) + 0.02
    material = material_lengths(hardened, scan, disc)
    assert np.sqrt(np.mean((material.lengths - exact) ** 2)) < 0.01 * exact.max()
    assert material.air == pytest.approx(0.02, abs=1e-6)
    assert material.linear == pytest.approx(1 / 0.0178, rel=0.02)
    plain = material_lengths(0.02 * exact, scan, disc)
    assert plain.hardening == pytest.approx(0, abs=1e-6) and plain.linear == pytest.approx(50)
    assert plain.attenuation == pytest.approx(0.02, rel=1e-3)
    assert 0.014 < material.attenuation < 0.0178


def test_the_coverage_of_a_disc_is_its_area():
    disc, grid = Disc(1.3, -0.7, 9.6), Grid((60, 50), 0.5)
    coverage = disc.coverage(grid)
    assert coverage.sum() * 0.25 == pytest.approx(np.pi * 9.6**2, rel=0.003)
    assert (coverage.min(), coverage.max()) == (0, 1)
    middle = [
        (coverage * c).sum() / coverage.sum()
        for c in np.meshgrid(grid.coordinates(1), grid.coordinates(0))
    ]
    np.testing.assert_allclose(middle, [1.3, -0.7], atol=0.01)


def test_what_is_no_disc_is_refused():
    scan = scan_of(180)
    t, angle = scan.coordinates()[None, :], scan.angles[:, None]
    reach = np.abs(60 * np.cos(angle)) + np.abs(25 * np.sin(angle))
    long = 0.02 * 60 * np.clip(1 - np.abs(t) / reach, 0, None) ** 0.5
    with pytest.raises(InputError, match="a disc"):
        find_disc(long, scan)
    wide = 0.02 * Disc(0, 0, 300.0).chords(scan)
    with pytest.raises(InputError, match="wider than the detector"):
        find_disc(wide, scan)
    for nothing in (np.zeros(wide.shape), -wide):
        with pytest.raises(InputError, match="positive line integrals"):
            find_disc(nothing, scan)
    with pytest.raises(InputError, match="NaN or infinity"):
        find_disc(np.full(wide.shape, np.nan), scan)
    with pytest.raises(ShapeError, match="sinogram has shape"):
        find_disc(wide[:-1], scan)
    with pytest.raises(ShapeError, match="seen has shape"):
        find_disc(wide, scan, seen=np.ones(3, bool))
    with pytest.raises(InputError, match="positive line integrals"):
        find_disc(wide, scan, seen=np.zeros(wide.shape, bool))


@pytest.mark.parametrize("angles", [[0.3], [0.3, 0.3], [0.3, 0.3, 0.3 + np.pi], [0.3, 0.31]])
def test_views_of_one_direction_do_not_place_a_disc(angles):
    scan = Parallel(angles, 200)
    with pytest.raises(InputError, match=r"edges|differ too little"):
        find_disc(0.02 * Disc(4.0, 3.0, 60.0).chords(scan), scan)


def test_a_rim_that_is_not_solid_is_refused():
    disc, scan = Disc(0.0, 0.0, 80.0), scan_of(180)
    exact = disc.chords(scan)
    speckled = 0.02 * exact * RANDOM.uniform(0, 1, exact.shape)
    with pytest.raises(InputError, match="rim of the disc"):
        material_lengths(speckled, scan, disc)
    with pytest.raises(InputError, match="rim is 0"):
        material_lengths(exact, scan, disc, rim=0)
    with pytest.raises(InputError, match="no ray passes"):
        material_lengths(exact, scan, Disc(0, 0, 1.5))
