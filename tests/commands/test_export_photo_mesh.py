"""``rift export --mesh`` of photographs: a sphere from its depths, open where nobody looked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.export import fused_depth
from rift_cl.commands.export.fused_depth import (
    Distances,
    chosen_cameras,
    disagreement,
    grid_of,
    places_of,
    reach_of,
)
from rift_cl.commands.export.mesh import surface, without_fragments
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera, look_at
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.captures.view import View
from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene

MIDDLE = np.array([0.3, -0.2, 0.1])


def cameras(count=8, size=(48, 56)):
    """All round a unit sphere, above and below by turns; in pixels high and wide."""
    found = []
    for number in range(count):
        turn, rise = 2 * np.pi * number / count, 1.5 * (-1) ** number
        place = MIDDLE + 3 * np.array([np.cos(turn), np.sin(turn), rise / 3])
        K = [[1.1 * size[1], 0, size[1] / 2], [0, 1.1 * size[1], size[0] / 2], [0, 0, 1]]
        found.append(Camera(size, K, look_at(place, MIDDLE, (0, 0, 1))))
    return found


def depth_of_sphere(camera):
    """Depth along the axis by pixel, from the quadratic equation."""
    fx, fy, cx, cy = camera.intrinsics
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    ways = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1)
    middle = camera.view[:3, :3] @ MIDDLE + camera.view[:3, 3]
    a, b, c = (ways**2).sum(axis=-1), ways @ middle, middle @ middle - 1
    inside = b**2 - a * c
    depth = (b - np.sqrt(np.maximum(inside, 0))) / a
    return np.where(inside > 0, depth, np.inf).astype(np.float32)


def fused(views, voxels=28):
    depths = [depth_of_sphere(camera) for camera in views]
    places = [places_of(camera, depth) for camera, depth in zip(views, depths, strict=True)]
    volume = Distances(grid_of(np.concatenate(places), voxels))
    for camera, depth in zip(views, depths, strict=True):
        volume.add(camera, depth)
    return volume


def test_depths_of_a_sphere_are_its_surface_seen_from_outside():
    volume = fused(cameras())
    grid = volume.grid
    vertices, triangles = surface(volume.inside(), grid, 0.0, volume.seen())
    away = np.linalg.norm(vertices - MIDDLE, axis=1)
    assert np.median(np.abs(away - 1)) < 0.15 * grid.spacing[0]
    assert np.abs(away - 1).max() < 2 * grid.spacing[0]
    corners = vertices[triangles].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = ((corners.mean(axis=1) - MIDDLE) * normals).sum(axis=1)
    assert (outward > 0).mean() > 0.99
    area = np.linalg.norm(normals, axis=1).sum() / 2
    assert area == pytest.approx(4 * np.pi, rel=0.1)


def test_where_nobody_looked_there_is_no_surface():
    volume = fused(cameras(2)[:1])
    vertices, _ = surface(volume.inside(), volume.grid, 0.0, volume.seen())
    way = cameras(2)[0].center - MIDDLE
    toward = (vertices - MIDDLE) @ way / np.linalg.norm(way)
    # Behind the sphere's limb lies what the distance's reach covers, and no far side.
    assert toward.max() > 0.9 and toward.min() > -5 * volume.grid.spacing[0] > -0.7


def test_a_slice_of_distances_is_their_definition():
    camera, volume = cameras()[0], fused(cameras()[:1])
    depth, grid = depth_of_sphere(camera), volume.grid
    inside, seen = volume.inside(), volume.seen()
    random = np.random.default_rng(0)
    for at in zip(*(random.integers(0, n, 60) for n in grid.shape), strict=True):
        place = np.array([grid.coordinates(axis)[at[axis]] for axis in range(3)])[::-1]
        x, y, z = camera.view[:3, :3] @ place + camera.view[:3, 3]
        column, row = (camera.K @ [x / z, y / z, 1])[:2]
        on = 0 <= column < camera.width and 0 <= row < camera.height
        away = (depth[int(row), int(column)] - z) / (4 * grid.spacing[0]) if on else -np.inf
        assert seen[at] == (away > -1)
        assert inside[at] == pytest.approx(-min(away, 1) if away > -1 else -1, abs=1e-4)


def spheres(views, radii):
    """What cameras see that each take a sphere's radius for another."""
    found = []
    for camera, radius in zip(views, radii, strict=True):
        moved = Camera(camera.size, camera.K, scaled_view(camera.view, 1 / radius))
        found.append(depth_of_sphere(moved) * np.float32(radius))
    return found


def scaled_view(view, factor):
    """The camera as it stands to a sphere ``1 / factor`` times as large about the same middle."""
    place = -view[:3, :3].T @ view[:3, 3]
    moved = view.copy()
    moved[:3, 3] = -view[:3, :3] @ (MIDDLE + (place - MIDDLE) * factor)
    return moved


@pytest.mark.full
def test_cameras_that_disagree_make_one_surface_and_not_a_shell_each():
    """A reach of four voxels shows the innermost shell, in pieces; the spheres' mean is 0.925."""
    views = cameras(16)
    depths = spheres(views, np.tile([0.85, 1.0, 0.9, 0.95], 4))
    places = [places_of(camera, depth) for camera, depth in zip(views, depths, strict=True)]
    grid = grid_of(np.concatenate(places), 96)
    apart = disagreement(list(zip(views[::2], depths[::2], strict=True)), places)
    assert 0.05 < apart < 0.15
    found = []
    for reach in (None, reach_of(apart, grid)):
        volume = Distances(grid, reach)
        for camera, depth in zip(views, depths, strict=True):
            volume.add(camera, depth)
        vertices, triangles = surface(volume.inside(), grid, 0.0, volume.seen())
        radius = np.median(np.linalg.norm(vertices - MIDDLE, axis=1))
        found.append((radius, without_fragments(vertices, triangles)[2]))
    (inner, many), (between, few) = found
    assert inner < 0.87 and 0.89 < between < 0.95
    assert many > 2 * few


def test_cameras_that_agree_keep_the_reach_of_four_voxels():
    views = cameras(16)
    depths = [depth_of_sphere(camera) for camera in views]
    places = [places_of(camera, depth) for camera, depth in zip(views, depths, strict=True)]
    grid = grid_of(np.concatenate(places), 28)
    apart = disagreement(list(zip(views[::2], depths[::2], strict=True)), places)
    assert reach_of(apart, grid) == 4 * grid.spacing[0]
    assert disagreement([(views[0], depths[0])], places[:1]) == 0


def test_small_pieces_are_left_out():
    """Two tetrahedra of 400 copies' worth of triangles, and a lone triangle."""
    corners = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    large = np.tile(corners, (100, 1))
    triangles = np.concatenate([large, corners + 4, [[8, 9, 10]]]).astype(np.uint32)
    vertices = np.arange(33, dtype=np.float32).reshape(11, 3)
    found, kept, dropped = without_fragments(vertices, triangles)
    np.testing.assert_array_equal(found, vertices[:8])
    np.testing.assert_array_equal(kept, triangles[:-1])
    assert dropped == 1


@pytest.mark.parametrize("voxels", [18, 19, 37, 96])
def test_the_longest_edge_has_the_voxels_that_are_asked_for(voxels):
    places = np.random.default_rng(voxels).normal(size=(5000, 3)) * [0.3, 1.0, 0.1]
    shape = grid_of(places, voxels).shape
    assert max(shape) == shape[1] == voxels and min(shape) > 10


def test_the_fewest_voxels_of_a_sphere_are_still_one():
    """With half as many there would be no more than the margin, and one voxel for the sphere."""
    volume = fused(cameras(), fused_depth._FEWEST)
    grid = volume.grid
    vertices, triangles = surface(volume.inside(), grid, 0.0, volume.seen())
    away = np.linalg.norm(vertices - MIDDLE, axis=1)
    assert np.abs(away - 1).max() < grid.spacing[0]
    corners = vertices[triangles].astype(float) - MIDDLE
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(4 / 3 * np.pi, rel=0.1)


@pytest.mark.parametrize("voxels", [8, 17])
def test_too_few_voxels_are_refused(ball, capsys, voxels):
    words = ["--capture", str(ball / "transforms.json"), "--voxels", str(voxels), "--to", "obj"]
    assert main(["export", "ball.ply", "--mesh", "--out", "ball.obj", *words]) != 0
    told = " ".join(capsys.readouterr().err.split())
    assert f"--voxels is {voxels}, wanted 18 or more" in told and not (ball / "ball.obj").exists()


def test_cameras_that_see_nothing_are_told_so():
    camera = cameras(1)[0]
    places = places_of(camera, np.full(camera.size, np.inf, np.float32))
    with pytest.raises(InputError, match="no camera sees"):
        grid_of(places, 16)


def test_a_large_picture_tells_few_places_from_edge_to_edge():
    camera = Camera((300, 400), [[400, 0, 200], [0, 400, 150], [0, 0, 1]], np.eye(4))
    places = places_of(camera, np.full(camera.size, 2, np.float32))
    assert len(places) == 20_000
    np.testing.assert_allclose(np.ptp(places, axis=0), [2 * 399 / 400, 2 * 299 / 400, 0], rtol=0.02)


def test_cameras_are_those_of_the_fit_without_their_apertures():
    view, lens = np.eye(4), Aperture(0.1, 2.0)
    K = [[400, 0, 200], [0, 400, 150], [0, 0, 1]]
    wide = Camera((300, 400), K, view, "fisheye")
    views = [View("a", Camera((300, 400), K, view, aperture=lens), Path("a"), None, None),
             View("b", wide, Path("b"), None, None)]  # fmt: skip
    (found,) = chosen_cameras(views, 4)
    assert found.size == (75, 100) and found.aperture is None
    assert found.intrinsics == (100, 100, 50, 37.5)
    assert chosen_cameras(views[1:], 4) == []


@pytest.fixture
def ball(tmp_path, monkeypatch):
    """Opaque splats on the sphere, and a capture's cameras without photographs."""
    monkeypatch.chdir(tmp_path)
    count = 600
    z = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ways = np.stack([*(np.sqrt(1 - z**2) * f(turn) for f in (np.cos, np.sin)), z], axis=1)
    SplatScene(MIDDLE + 0.95 * ways, np.full((count, 3), np.log(0.06)), [[1, 0, 0, 0]] * count,
               np.full(count, 5.0), np.zeros((count, 1, 3))).save("ball.ply")  # fmt: skip
    views = cameras()
    write_json(tmp_path / "transforms.json", transforms_of(views, [f"{k}.png" for k in range(8)]))
    return tmp_path


def test_a_scene_of_photographs_becomes_a_mesh(ball, capsys):
    words = ["--capture", str(ball / "transforms.json"), "--voxels", "24", "--to", "obj", "--quiet"]
    assert main(["export", "ball.ply", "--mesh", "--out", "ball.obj", *words]) == 0
    assert "from 8 depth maps" in capsys.readouterr().out
    lines = (ball / "ball.obj").read_text().splitlines()
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    away = np.linalg.norm(vertices - MIDDLE, axis=1)
    assert np.median(away) == pytest.approx(1, abs=0.08)


def test_a_mesh_of_flat_splats_lies_before_their_surface_by_a_third_of_their_width(ball):
    """Where splats overlap, those whose centres are nearer to the camera cover the others."""
    count, width = 750, 0.1
    z = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    x, y = (np.sqrt(1 - z**2) * f(turn) for f in (np.cos, np.sin))
    SplatScene(
        MIDDLE + np.stack([x, y, z], axis=1),
        np.tile(np.log([width, width, 0.003]), (count, 1)),
        # The least turns that take z to the directions.
        np.stack([1 + z, -y, x, 0 * z], axis=1),
        np.full(count, 5.0),
        np.zeros((count, 1, 3)),
    ).save("flat.ply")
    views = transforms_of(cameras(16, (120, 140)), [f"{k}.png" for k in range(16)])
    write_json(ball / "transforms.json", views)
    words = ["--capture", str(ball), "--voxels", "48", "--to", "obj", "--quiet"]
    assert main(["export", "flat.ply", "--mesh", "--out", "flat.obj", *words]) == 0
    lines = (ball / "flat.obj").read_text().splitlines()
    vertices = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    away = np.linalg.norm(vertices - MIDDLE, axis=1)
    assert np.median(away) == pytest.approx(1.035, abs=0.005)


def test_depths_that_disagree_are_told(ball, capsys):
    """A fog of splats as deep as a third of the sphere, and one splat far before it."""
    scene = SplatScene.load("ball.ply")
    shares = np.random.default_rng(0).uniform(0.65, 1, (len(scene), 1)) / 0.95
    shares[7] = 2.2
    fog = np.full(len(scene), -0.5, np.float32)
    fog[7] = 5
    means = (MIDDLE + (scene.means - MIDDLE) * shares).astype(np.float32)
    replace(scene, means=means, logit_opacities=fog).save("fog.ply")
    words = ["--capture", str(ball / "transforms.json"), "--voxels", "48", "--to", "obj"]
    assert main(["export", "fog.ply", "--mesh", "--out", "fog.obj", *words]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "depths disagree by 0." in told and "were left out" in told


def test_a_grid_without_room_is_refused_before_it_is_made(ball, monkeypatch, capsys):
    monkeypatch.setattr(fused_depth, "host_budget", lambda: 1000)
    words = ["--capture", str(ball / "transforms.json"), "--voxels", "24", "--to", "obj"]
    assert main(["export", "ball.ply", "--mesh", "--out", "ball.obj", *words]) != 0
    told = capsys.readouterr().err
    assert "--voxels 24" in told and "16/16 depths" not in told
    assert not (ball / "ball.obj").exists()


def test_a_level_is_about_densities(ball, capsys):
    words = ["--capture", str(ball / "transforms.json"), "--level", "1"]
    assert main(["export", "ball.ply", "--mesh", *words]) == 3
    assert "--level" in capsys.readouterr().err
