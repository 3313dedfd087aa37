"""Colours by lobes: against the twin, and what becomes of odd ones."""

from __future__ import annotations

import numpy as np
import pytest
from lobe_scenes import (
    CAMERA,
    CASES,
    MOST_MODES,
    Lobes,
    error,
    facing,
    random_lobes,
    seen,
    seen_grad,
)
from projection_scenes import camera_of

from rift_cl.basis.angular import SphericalHarmonics
from rift_cl.errors import InputError, ShapeError
from rift_cl.reference.lobes import shade_lobes
from rift_cl.reference.splat_projection import shade_splats
from rift_cl.splat.features import shade, shade_grad


@pytest.mark.full
@pytest.mark.once
@pytest.mark.parametrize("kind, count", MOST_MODES)
def test_colors_of_most_modes_are_the_twins(device, kind, count):
    check_colors(device, kind, count)


@pytest.mark.each
@pytest.mark.parametrize("kind, count", CASES)
def test_colors_are_the_twins(device, kind, count):
    check_colors(device, kind, count)


def check_colors(device, kind, count):
    for given in (random_lobes(kind, count), facing(random_lobes(kind, count))):
        colors, twin = device.get(seen(device, given)), given.colors()
        assert 0.001 < (twin == 0).mean() < 0.4, "some are held at zero, not most"
        # The narrowest lobes are 0.02 wide: a direction's rounding counts fifty times.
        np.testing.assert_allclose(colors, twin, atol=4e-5, rtol=1e-6)
        assert error(colors, twin) < 5e-6


def test_twin_of_harmonics_is_the_twin_of_splats():
    given = random_lobes("lg", 16)
    means, linear, _ = given.exact()
    found = shade_lobes(SphericalHarmonics(3), means, linear, None, CAMERA)
    np.testing.assert_allclose(found, shade_splats(means, linear, CAMERA), atol=1e-13)


def test_harmonics_are_shaded_as_ever(device):
    """Named or not, and by the kernel of harmonics: the same bits."""
    given = random_lobes("lg", 16)
    arrays = [device.array(a) for a in (given.means, given.linear)]
    culled = device.zeros((200,), np.uint8)
    plain = device.get(shade(device, *arrays, CAMERA, culled))
    named = device.get(shade(device, *arrays, CAMERA, culled, lobes=None, angular="sh"))
    direct = device.empty((200, 3))
    center = np.array([*CAMERA.center, 0], np.float32)
    sizes = {"COEFFICIENTS": 16, "STRIDE": 3}
    given = {"means": arrays[0], "sh": arrays[1], "culled": culled, "features": direct}
    device.launch("splat_shade", (200,), **given, center=center, count=200, **sizes)
    assert plain.tobytes() == named.tobytes() == device.get(direct).tobytes()


@pytest.mark.parametrize("kind, count", CASES)
def test_only_splats_that_are_drawn_and_only_three_columns_are_written(device, kind, count):
    given = random_lobes(kind, count)
    culled = (np.arange(200) % 3 == 0).astype(np.uint8)
    table = device.array(np.full((200, 3), 7, np.float32))
    seen(device, given, culled=culled, into=table)
    found = device.get(table)
    assert not found[culled > 0].any() and found[culled == 0].any(1).mean() > 0.9
    if kind == "sg":
        wide = device.array(np.full((200, 5), 7, np.float32))
        seen(device, given, culled=culled, into=wide)
        np.testing.assert_array_equal(device.get(wide)[:, :3], found)
        assert (device.get(wide)[:, 3:] == 7).all()


@pytest.mark.parametrize("kind, count", CASES)
def test_same_call_gives_the_same_bits(device, kind, count):
    given = random_lobes(kind, count)
    first, second = (device.get(seen(device, given)) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    incoming = np.random.default_rng(1).standard_normal((200, 3)).astype(np.float32)
    one, other = (seen_grad(device, given, incoming) for _ in range(2))
    assert all(one[name].tobytes() == other[name].tobytes() for name in one)


@pytest.mark.parametrize("kind, count", CASES)
@pytest.mark.parametrize("where", ["lobes", "linear", "frame"])
def test_color_that_is_no_number_is_black_and_spoils_nothing(device, kind, count, where):
    given, bad = random_lobes(kind, count), random_lobes(kind, count)
    if where == "frame":
        bad.lobes[7, : 3 if kind == "sg" else 4] = 0
    else:
        odd = {"lobes": bad.lobes, "linear": bad.linear.reshape(200, -1)}[where]
        odd[7, -1], odd[8, 0], odd[9, 1] = np.nan, np.inf, -np.inf
    spoilt = np.array([7]) if where == "frame" else np.array([7, 8, 9])
    colors = device.get(seen(device, bad))
    assert not colors[spoilt].any() and not bad.colors()[spoilt].any()
    incoming = np.ones((200, 3), np.float32)
    found, healthy = (seen_grad(device, lobes, incoming) for lobes in (bad, given))
    rest = np.setdiff1d(np.arange(200), spoilt)
    assert device.get(seen(device, given))[rest].tobytes() == colors[rest].tobytes()
    for name in ("linear", "lobes", "means"):
        assert not found[name][spoilt].any()
        assert found[name][rest].tobytes() == healthy[name][rest].tobytes()
    assert np.isfinite(found["view"]).all()


@pytest.mark.parametrize("kind, count", CASES)
@pytest.mark.parametrize("length", [1e-25, 1e25])
def test_lengths_of_quaternions_and_axes_do_not_matter(device, kind, count, length):
    given, longer = random_lobes(kind, count), random_lobes(kind, count)
    longer.lobes[:, : 3 if kind == "sg" else 4] *= np.float32(length)
    colors, others = (device.get(seen(device, lobes)) for lobes in (given, longer))
    np.testing.assert_allclose(colors, others, atol=3e-5)


@pytest.mark.parametrize("kind, count", CASES)
@pytest.mark.parametrize("number", [-1e30, -30.0, 30.0, 1e30])
def test_widths_and_sharpness_of_any_size_have_a_color(device, kind, count, number):
    given = facing(random_lobes(kind, count), aside=0.003)
    given.lobes[:, 3 if kind == "sg" else 4] = number
    given.lobes[:, 3 if kind == "sg" else -1] = number
    colors = device.get(seen(device, given))
    np.testing.assert_allclose(colors, given.colors(), atol=1e-4)
    found = seen_grad(device, given, np.ones((200, 3), np.float32))
    assert all(np.isfinite(array).all() for array in found.values())
    assert not found["lobes"][:, 3 if kind == "sg" else 4].any()


@pytest.mark.parametrize("kind, count", [("hg", 8), ("lg", 9)])
@pytest.mark.parametrize("aside", [0.0, 1e-4, 0.005, 0.03])
def test_modes_fade_towards_the_antipode(device, kind, count, aside):
    given = random_lobes(kind, count)
    given.lobes[:, 4:] = -0.2
    lobes = facing(given, aside).lobes
    # Half a turn about t takes the axis to its opposite.
    w, x, y, z = lobes[:, :4].T.copy()
    lobes[:, :4] = np.stack([-x, w, z, -y], 1)
    given = Lobes(kind, given.means, given.linear, lobes)
    colors = device.get(seen(device, given))
    np.testing.assert_allclose(colors, given.colors(), atol=1e-4)
    if aside < 0.001:
        flat = np.maximum(0.28209479 * given.linear[:, 0] + 0.5, 0)
        np.testing.assert_allclose(colors, flat, atol=1e-3)
    found = seen_grad(device, given, np.ones((200, 3), np.float32))
    assert all(np.isfinite(array).all() for array in found.values())


@pytest.mark.parametrize("kind, count", CASES)
def test_splat_where_the_camera_stands_has_a_color_and_no_gradient_by_direction(
    device, kind, count
):
    camera = camera_of("pinhole", distance=0.0)
    given = random_lobes(kind, count, 1)
    given.means[:] = camera.center
    assert np.isfinite(device.get(seen(device, given, camera=camera))).all()
    found = seen_grad(device, given, np.ones((1, 3), np.float32), camera=camera)
    assert all(np.isfinite(array).all() for array in found.values())


def test_no_splats_have_no_colors(device):
    assert seen(device, random_lobes("hg", 8, 0)).shape == (0, 3)


def test_counts_that_do_not_fit_are_refused(device):
    given = random_lobes("hg", 8, 5)
    arrays = [device.array(a) for a in (given.means, given.linear)]
    culled, lobes = device.zeros((5,), np.uint8), device.array(given.lobes)

    def shaded(sh=arrays[1], **lobes):
        return shade(device, arrays[0], sh, CAMERA, culled, **lobes)

    with pytest.raises(ShapeError, match=r"lobes has shape \(5, 6\)"):
        shaded(lobes=lobes, angular="lg")
    with pytest.raises(ShapeError, match=r"\(5, 28\).*8 functions.*'sg'"):
        shaded(lobes=lobes, angular="sg")
    with pytest.raises(InputError, match="have no lobes"):
        shaded(angular="hg")
    with pytest.raises(InputError, match=r"lobes.*angular='sh'"):
        shaded(lobes=lobes)
    with pytest.raises(InputError, match="'zernike'"):
        shaded(lobes=lobes, angular="zernike")
    with pytest.raises(InputError, match="no spherical harmonics"):
        shaded(None, lobes=lobes, angular="hg")
    many = device.zeros((5, 37, 3))
    with pytest.raises(InputError, match="modes is 37"):
        shaded(many, lobes=lobes, angular="hg")
    with pytest.raises(InputError, match="functions is 1"):
        shaded(device.zeros((5, 1, 3)), lobes=lobes, angular="sg")


def test_gradient_by_lobes_that_does_not_fit_is_refused(device):
    given = random_lobes("hg", 8, 5)
    features = seen(device, given)
    with pytest.raises(ShapeError, match=r"grad_lobes has shape \(5, 5\)"):
        shade_grad(
            device,
            *(device.array(given.means), device.array(given.linear), CAMERA),
            features=features,
            gradients=type("Incoming", (), {"features": features}),
            lobes=device.array(given.lobes),
            angular="hg",
            grad_lobes=device.zeros((5, 5)),
        )
