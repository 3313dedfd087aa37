"""``rift export --mesh``: closed surfaces of the right size and side, as trimesh reads them."""

from __future__ import annotations

import io

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.export.mesh import surface
from rift_cl.geometry import Grid
from rift_cl.io.scenes.mesh_files import MESH_FORMATS
from rift_cl.io.scenes.splat_scene import SplatScene, XrayScene

SIZES, MIDDLE = np.array([1.0, 1.5, 0.7]), np.array([10.0, -4.0, 2.0])


@pytest.fixture
def bone(tmp_path, monkeypatch):
    """One Gaussian of density 2 at its peak: its surfaces are ellipsoids."""
    monkeypatch.chdir(tmp_path)
    XrayScene(MIDDLE[None], np.log(SIZES)[None], [[1, 0, 0, 0]], [np.log(2.0)],
              np.zeros((1, 1, 3))).save("bone.ply")  # fmt: skip
    return tmp_path


def read(path):
    trimesh = pytest.importorskip("trimesh")
    return trimesh.load(path, force="mesh", process=path.suffix == ".stl")


@pytest.mark.parametrize("name", list(MESH_FORMATS))
def test_a_gaussians_surface_is_its_ellipsoid(name, bone):
    """Where 2 exp(-r^2 / 2) is 1, r is sqrt(2 ln 2); the volume is that of the ellipsoid."""
    out = bone / f"surface.{name}"
    arguments = ["--to", name, "--out", str(out), "--level", "1", "--voxels", "64", "--quiet"]
    assert main(["export", "bone.ply", "--mesh", *arguments]) == 0
    mesh = read(out)
    radii = SIZES * np.sqrt(2 * np.log(2))
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * radii.prod(), rel=0.02)
    low, high = MIDDLE - radii, MIDDLE + radii
    if name == "glb":
        low, high = low[[0, 2, 1]], high[[0, 2, 1]]
        low[2], high[2] = -high[2], -low[2]
    np.testing.assert_allclose(mesh.bounds, [low, high], atol=0.04)


def test_a_scale_multiplies_the_places_of_a_surface(bone):
    arguments = ["export", "bone.ply", "--mesh", "--level", "1", "--voxels", "32", "--quiet"]
    assert main([*arguments, "--out", "a.stl"]) == 0
    assert main([*arguments, "--out", "b.stl", "--scale", "0.25"]) == 0
    whole, quarter = read(bone / "a.stl"), read(bone / "b.stl")
    np.testing.assert_array_equal(quarter.bounds, whole.bounds / 4)


@pytest.mark.full
def test_without_a_level_inside_and_outside_are_parted(bone, capsys):
    assert main(["export", "bone.ply", "--mesh", "--out", "a.stl", "--to", "stl", "--quiet"]) == 0
    said = capsys.readouterr().out
    level = float(said.split("density ")[1].split(",")[0])
    assert 0.2 < level < 1.2
    before = (bone / "a.stl").read_bytes()
    assert main(["export", "bone.ply", "--mesh", "--out", "a.stl", "--to", "stl"]) == 5
    again = ["--out", "b.stl", "--to", "stl", "--level", str(level)]
    assert main(["export", "bone.ply", "--mesh", *again]) == 0
    assert len((bone / "b.stl").read_bytes()) == len(before)


def test_surfaces_end_at_the_edge_of_the_grid_closed():
    vertices, triangles = surface(np.ones((3, 4, 5), np.float32), Grid((3, 4, 5), 0.5), 0.5)
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(io.BytesIO(MESH_FORMATS["ply"](vertices, triangles)), "ply")
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.extents, [2.5, 2.0, 1.5])
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), 0, atol=1e-6)


def test_what_has_no_surface_is_told_so(bone, capsys):
    arrays = {"means": [[0, 0, 0]], "log_scales": np.zeros((1, 3)), "quats": [[1, 0, 0, 0]]}
    SplatScene(**arrays, logit_opacities=[0.0], sh=np.zeros((1, 1, 3))).save("photo.ply")
    for arguments, words in (
        (["photo.ply", "--mesh"], "--capture"),
        (["bone.ply", "--mesh", "--level", "5"], "there is no surface"),
        (["bone.ply", "--mesh", "--level", "-1"], "there is no surface"),
        (["bone.ply", "--mesh", "--to", "spz"], "no triangles"),
        (["bone.ply", "--mesh", "--voxels", "2"], "wanted 8 to 2048"),
        (["photo.ply", "--to", "stl"], "add --mesh"),
    ):
        assert main(["export", *arguments, "--out", "new"]) == 3
        assert words in " ".join(capsys.readouterr().err.split())
    assert sorted(entry.name for entry in bone.iterdir()) == ["bone.ply", "photo.ply"]
