"""All views of additive splats at once: the pictures and gradients that the renderer has of each.

``tools/bases/additive.py`` draws parallel views as one mosaic and goes to the screen by matrices of
its own; the renderer, view by view, is what both must agree with.
"""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.cl import open_device
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.splat.splats import Splats

TOOLS = Path(__file__).parents[2] / "tools"
SIZE = (12, 21)


@pytest.fixture
def tool(monkeypatch):
    """A module of the tools by its name."""
    monkeypatch.setattr(sys, "path", [str(TOOLS), *sys.path])
    return importlib.import_module


def problem(tool, order, dim):
    """A renderer, cameras, modes, and four splats with coefficients of two channels."""
    sets, additive, views = (tool(f"bases.{n}") for n in ("mode_sets", "additive", "views"))
    modes = sets.in_plane(order) if dim == 2 else sets.in_space(order)
    random, count = np.random.default_rng(order), 4
    means = random.uniform(-9, 9, (count, 3)) * (1, 1, dim - 2)
    turns = np.array([[1.0, 0, 0, 0.4]]) + (dim - 2) * 0.3 * random.normal(size=(count, 4))
    scales = np.log(random.uniform(1.5, 2.5, (count, 3)))
    geometry = additive.Geometry.of_flat(np.concatenate([means, turns, scales], axis=1))
    cameras = views.turned_cameras(*SIZE, np.array([0.2, 1.4, 2.9, 4.0, 5.5]))
    cameras = [views.upright_camera(*SIZE)] if dim == 2 else cameras
    renderer = views.additive_renderer(open_device(), tile=8, eps2d=0.1)
    return renderer, cameras, modes, geometry, random.normal(size=(2, count, modes.count, 2))


def drawn_view_by_view(renderer, cameras, modes, geometry, c):
    """A frame of every view, by the renderer itself."""
    full = np.einsum("mk,nkc->nmc", modes.matrix, c)
    splats = Splats.upload(
        renderer.device,
        means=geometry.means,
        quats=geometry.quats,
        scales=np.exp(geometry.log_scales),
        opacities=np.ones(len(c)),
        colors=full[:, 0],
        color_modes=full[:, 1:] if full.shape[1] > 1 else None,
    )
    return [renderer.forward(splats, camera) for camera in cameras]


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_mosaic_shows_what_every_view_shows(tool, order, dim):
    *given, (c, _) = problem(tool, order, dim)
    device = given[0].device
    wanted = [device.get(frame.image) for frame in drawn_view_by_view(*given, c)]
    seen = tool("bases.additive").Placed(*given, 2).render(c)
    np.testing.assert_allclose(seen, wanted, atol=2e-5 * np.abs(wanted).max())
    assert np.abs(wanted).max() > 1


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_pictures_are_linear_and_have_an_adjoint(tool, order, dim):
    *given, (c, other) = problem(tool, order, dim)
    placed = tool("bases.additive").Placed(*given, 2)
    seen = placed.render(c)
    both = placed.render(c + 2 * other)
    np.testing.assert_allclose(both, seen + 2 * placed.render(other), atol=1e-4)
    pictures = np.random.default_rng(1).normal(size=seen.shape)
    assert np.vdot(seen, pictures) == pytest.approx(np.vdot(c, placed.adjoint(pictures)), rel=1e-4)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_gradient_by_the_geometry_is_the_sum_over_views(tool, order):
    *given, (c, _) = problem(tool, order, 3)
    renderer, _, _, geometry = given
    placed = tool("bases.additive").Placed(*given, 2)
    pictures = np.random.default_rng(1).normal(size=placed.render(c).shape)
    wanted = np.zeros((len(c), 10))
    frames = drawn_view_by_view(*given, c)
    for frame, picture in zip(frames, pictures.astype(np.float32), strict=True):
        found = renderer.backward(frame, renderer.device.array(picture)).splats
        parts = [renderer.device.get(g) for g in (found.means, found.quats, found.scales)]
        wanted += np.concatenate(parts, axis=1)
    wanted[:, 7:] *= np.exp(geometry.log_scales)
    found = placed.geometry_gradient(c, pictures)
    np.testing.assert_allclose(found, wanted, atol=1e-4 * np.abs(wanted).max())


def test_no_splat_is_seen_in_the_next_cell(tool):
    *given, (c, _) = problem(tool, 0, 3)
    placed = tool("bases.additive").Placed(*given, 2)
    mosaic = tool("bases.mosaic").Mosaic(given[1], 8)
    boxes = np.tile(np.array([[-4, -3, 99, 99], [1, 1, 1, 5]], np.int32), (5, 1))
    cut = mosaic.cut_boxes(boxes)
    # Cells of 16 x 24 pixels are 2 x 3 tiles; two columns of them are about square.
    np.testing.assert_array_equal(
        cut[::2], [[0, 0, 3, 2], [3, 0, 6, 2], [0, 2, 3, 4], [3, 2, 6, 4], [0, 4, 3, 6]]
    )
    assert not cut[1::2].any()
    pictures = np.zeros(placed.render(c).shape)
    pictures[2] = 1
    only = placed.adjoint(pictures)
    given[1] = [given[1][2]]
    alone = tool("bases.additive").Placed(*given, 2)
    alone.render(c)
    np.testing.assert_allclose(only, alone.adjoint(pictures[2:3]), rtol=1e-4, atol=1e-5)


def test_views_that_have_no_common_mosaic_are_refused(tool):
    mosaic, camera = tool("bases.mosaic"), tool("bases.views").upright_camera(8, 8)
    wider = Camera((8, 8), [[2, 0, 4], [0, 2, 4], [0, 0, 1]], np.eye(4), "ortho")
    with pytest.raises(InputError, match="one matrix K"):
        mosaic.Mosaic([camera, wider], 8)
    deep = Camera((8, 8), [[2, 0, 4], [0, 2, 4], [0, 0, 1]], np.eye(4))
    with pytest.raises(InputError, match="orthographic"):
        mosaic.Mosaic([camera, deep], 8)


def test_turns_by_matrix_and_by_quaternion_are_the_same(tool):
    mosaic = tool("bases.mosaic")
    random = np.random.default_rng(0)
    for _ in range(20):
        q = random.normal(size=4)
        q /= np.linalg.norm(q)
        w, x, y, z = q
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        found = mosaic.quaternion_of(turn)
        np.testing.assert_allclose(found * np.sign(found @ q), q, atol=1e-12)
        assert np.linalg.norm(mosaic.left_product(q) @ [1, 0, 0, 0] - q) == 0


def test_the_density_in_space_has_the_pictures_as_its_line_integrals(tool):
    sets, additive, views = (tool(f"bases.{n}") for n in ("mode_sets", "additive", "views"))
    modes, n = sets.in_space(2), 20
    flat = np.array([[1.0, -2, 0.5, 0.8, 0.2, -0.3, 0.4, *np.log([1.6, 2.0, 2.4])]])
    geometry = additive.Geometry.of_flat(flat)
    c = np.random.default_rng(3).normal(size=(1, modes.count, 1))
    renderer = views.additive_renderer(open_device(), tile=8, eps2d=0.0)
    camera = views.turned_cameras(n, n, np.zeros(1))
    picture = additive.Placed(renderer, camera, modes, geometry, 1).render(c)[0, ..., 0]
    line = np.arange(n) - (n - 1) / 2
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    volume = tool("bases.densities").density(geometry, modes, c, points).reshape(n, n, n)
    np.testing.assert_allclose(volume.sum(axis=1), picture, atol=2e-3 * np.abs(picture).max())


@pytest.mark.parametrize("stack", [1, 2])
def test_exact_coefficients_are_those_that_drew_the_pictures(tool, stack):
    renderer, cameras, modes, geometry, _ = problem(tool, 1, 3)
    flat = geometry.flat()
    if stack == 2:
        # Two splats in each half of the picture's rows, so far apart that they do not meet.
        flat[:, :3] = [[-5, 3, -3], [5, -3, -3], [-4, -4, 3], [5, 2, 3]]
        flat[:, 3:7] = [1, 0, 0, 0]
        flat[:, 7:] = np.log([1.5, 1.5, 0.4])
    placed = tool("bases.additive").Placed(
        renderer, cameras, modes, tool("bases.additive").Geometry.of_flat(flat), 2
    )
    c = np.random.default_rng(2).normal(size=(4, modes.count, 2))
    columns = np.concatenate(list(placed.columns(stack)), axis=-1)
    assert columns.shape == (stack, 5 * SIZE[0] * SIZE[1] // stack, 4 // stack * modes.count)
    found = tool("bases.exact").solved(placed, placed.render(c), 1e-9, stack)
    np.testing.assert_allclose(found, c, atol=2e-3)


def test_a_case_without_exact_solves_is_judged_by_the_best_there_are(tool):
    """Large budgets have conjugate gradients alone; they are drawn and count all the same."""
    races, runs = tool("bases.races"), []
    for samples, solve in ((24, 4), (24, 0), (40, 4), (40, 12)):
        for basis, better in (("Gaussian", 0), ("HG 1", 1 if solve in (0, 12) else 9)):
            history = [{"step": s, "wall": s, "cpu": s, "psnr": 20.0 + s + better} for s in (2, 4)]
            run = {"basis": basis, "seed": 0, "samples": samples, "budget": 10 * samples}
            run |= {"solve": solve, "views": 3, "target": "balls", "history": history}
            runs.append(run | {"per_splat": 3, "wall_ms": 1.0, "cpu_ms": 1.0, "pairs": 1.0})
    result = {"short": 2, "runs": runs}
    said = races.race_verdicts(result)
    assert "+1 dB" in said[0] and "most exact solves" in said[0] and "2 of 2" in said[0]
    assert set(races.race_pictures(result)) >= {"time_240", "time_400", "parameters_short"}
    assert len(list(races.race_tables(result))) == 7
