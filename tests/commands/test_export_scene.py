"""What an export makes of scenes: turned, made plain, with a sentence for what is lost."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rift_cl.basis.angular import SphericalHarmonics, angular_basis
from rift_cl.cl.discovery import default_device
from rift_cl.commands.export.axes import harmonics_turn, matrices_of, sphere, turn_between, turned
from rift_cl.commands.export.plain_scene import plain_scene
from rift_cl.geometry import Camera
from rift_cl.io.images.display_light import to_display
from rift_cl.io.scenes.splat_activations import amplitudes_of
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.metrics import psnr
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings

ANGLE, SAME = 0.7, np.eye(3)
TURN = np.array(
    [[np.cos(ANGLE), 0, np.sin(ANGLE)], [0, 1, 0], [-np.sin(ANGLE), 0, np.cos(ANGLE)]]
) @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])


def scene(count: int = 60, **more: object) -> SplatScene:
    random = np.random.default_rng(3)
    arrays = {
        "means": random.normal(0, 0.5, (count, 3)),
        "log_scales": random.uniform(-3, -1.2, (count, 3)),
        "quats": random.normal(size=(count, 4)),
        "logit_opacities": random.normal(0, 2, count),
        "sh": random.normal(0, 0.2, (count, 16, 3)),
    }
    return SplatScene(**(arrays | more))  # type: ignore[arg-type]


def drawn(splats: SplatScene, turn: np.ndarray = SAME) -> np.ndarray:
    """What a camera sees that is turned as the scene is."""
    view = np.eye(4)
    view[:3, :3] = turn.T
    view[2, 3] = 3
    camera = Camera((60, 80), K=[[80, 0, 40], [0, 80, 30], [0, 0, 1]], view=view)
    device = default_device()
    settings = SplatSettings(activation=splats.activation, angular=splats.angular)
    frame = Renderer(settings, device=device).forward(splats.upload(device), camera)
    return device.get(frame.image)


@pytest.mark.parametrize("start", [[0, 0, 1.0], [0, -1, 0], [0, 1, 0], [0.6, 0, -0.8], [1, 0, 0]])
def test_a_turn_between_directions_is_the_least(start: list[float]) -> None:
    end = np.array([0, 1.0, 0])
    turn = turn_between(np.array(start), end)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(turn @ start, end, atol=1e-12)
    assert np.linalg.det(turn) > 0
    assert (np.trace(turn) - 1) / 2 == pytest.approx(np.dot(start, end), abs=1e-12)


def test_harmonics_turn_with_the_scene() -> None:
    directions = sphere(40) @ TURN.T
    functions = SphericalHarmonics(4).functions(None, directions)
    matrix = harmonics_turn(TURN, 4)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(25), atol=1e-10)
    before = SphericalHarmonics(4).functions(None, directions @ TURN)
    np.testing.assert_allclose(functions @ matrix, before, atol=1e-10)


def test_a_turned_scene_looks_the_same_to_a_turned_camera() -> None:
    given = scene()
    np.testing.assert_allclose(drawn(turned(given, TURN), TURN), drawn(given), atol=2e-4)
    assert turned(given, np.eye(3)) is given


def test_plain_scenes_stay_as_they_are() -> None:
    given = scene()
    found, notes = plain_scene(given)
    assert notes == []
    for name in ("means", "log_scales", "quats", "logit_opacities", "sh"):
        np.testing.assert_array_equal(getattr(found, name), getattr(given, name))


def test_splats_that_are_not_drawn_are_left_out() -> None:
    given = scene()
    quats = given.quats.copy()
    quats[7] = 0
    found, _ = plain_scene(dataclasses.replace(given, quats=quats))
    assert len(found) == 59
    np.testing.assert_array_equal(found.means, np.delete(given.means, 7, axis=0))


def test_linear_light_becomes_display_light_and_its_error_is_said() -> None:
    colors = np.random.default_rng(1).uniform(0.05, 0.9, (60, 3)).astype(np.float32)
    constant = ((colors - 0.5) / 0.28209479177387814)[:, None]
    found, notes = plain_scene(scene(sh=constant, light="linear"))
    to_display(colors)
    np.testing.assert_allclose(0.5 + 0.28209479177387814 * found.sh[:, 0], colors, atol=1e-5)
    assert "differ by 0.000" in notes[0] and "blend" in notes[1]


def test_lobes_become_the_nearest_harmonics() -> None:
    """Lobes that are harmonics nearly, being wide, come out as what they were."""
    basis = angular_basis("sg", 3)
    random = np.random.default_rng(2)
    lobes = basis.start_geometry(random.normal(size=(60, 3)))
    sh = np.concatenate(
        [np.zeros((60, 1, 3)), random.uniform(0, 0.2, (60, basis.n_linear - 1, 3))], 1
    )
    given = scene(lobes=lobes, angular="sg", sh=sh)
    found, notes = plain_scene(given)
    assert found.angular == "sh" and found.degree == 3
    said = float(notes[0].split("differ by ")[1].split()[0])
    assert said < 0.05
    assert psnr(drawn(found), drawn(given)) > 30


@pytest.mark.full
@pytest.mark.parametrize("activation", ["exp", "square"])
def test_activations_become_gaussians_of_the_same_peak_and_integral(activation: str) -> None:
    given = scene(1, activation=activation, means=np.zeros((1, 3)), logit_opacities=[2.5],
                  log_scales=np.full((1, 3), -1.4), sh=np.full((1, 1, 3), 1.5))  # fmt: skip
    found, notes = plain_scene(given)
    assert activation in notes[0]
    before, after = drawn(given)[..., 0], drawn(found)[..., 0]
    assert after.max() == pytest.approx(before.max(), rel=0.02)
    assert after.sum() == pytest.approx(before.sum(), rel=0.03)
    depth = float(amplitudes_of(given.logit_opacities)[0])
    assert 1 / (1 + np.exp(-float(found.logit_opacities[0]))) == pytest.approx(1 - np.exp(-depth))


def test_modes_become_the_gaussian_of_the_same_moments() -> None:
    """A density 1 + s x is one Gaussian, moved by s and narrower; of small s, by little."""
    shape = np.zeros((1, 9))
    shape[0, 0], shape[0, 3] = 0.1, 0.3
    color = np.zeros((1, 3, 3))
    color[0, 0] = 0.2
    given = scene(1, shape_modes=shape, color_modes=color)
    found, notes = plain_scene(given)
    assert "modes" in notes[0]
    frame = matrices_of(given.quats.astype(float))[0] * np.exp(given.log_scales[0])
    np.testing.assert_allclose(found.means[0], given.means[0] + 0.1 * frame[:, 0], atol=1e-4)
    rotation = matrices_of(found.quats.astype(float))[0]
    axes = rotation * np.exp(found.log_scales[0])
    wanted = frame @ np.diag([1 + np.sqrt(2) * 0.3 - 0.01, 1, 1]) @ frame.T
    np.testing.assert_allclose(axes @ axes.T, wanted, atol=1e-5)
    constant = given.sh[0, 0] + 0.1 * 0.2 / 0.28209479177387814
    np.testing.assert_allclose(found.sh[0, 0], constant, atol=1e-5)


@pytest.mark.full
def test_modes_made_plain_look_like_what_they_were() -> None:
    random = np.random.default_rng(9)
    given = scene(shape_modes=random.normal(0, 0.2, (60, 9)))
    bare = dataclasses.replace(given, shape_modes=None)
    found, _ = plain_scene(given)
    assert psnr(drawn(found), drawn(given)) > psnr(drawn(bare), drawn(given)) + 1
