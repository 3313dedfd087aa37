"""The torch reference code of gsplat, where it is installed, projects and shades alike."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import Kind, projected_on, random_splats, upload

from rift_cl.splat.features import shade
from rift_cl.splat.projection import project
from rift_cl.splat.settings import SplatSettings

torch = pytest.importorskip("torch", reason="torch is not installed")
gsplat = pytest.importorskip("gsplat.cuda._torch_impl", reason="gsplat is not installed")


@pytest.mark.parametrize("model", ["pinhole", "ortho", "fisheye"])
def test_gsplat_projects_alike(device, model):
    kind = Kind(model, settings=SplatSettings(antialiased=True))
    values, camera = random_splats(500, seed=9), kind.camera
    tensors = {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}
    covars, _ = gsplat._quat_scale_to_covar_preci(tensors["quats"], tensors["scales"])
    radii, means, depths, conics, kept = gsplat._fully_fused_projection(
        tensors["means"], covars, torch.tensor(camera.view)[None], torch.tensor(camera.K)[None],
        camera.width, camera.height, calc_compensations=True, camera_model=model,
    )  # fmt: skip
    found = projected_on(device, values, kind)
    drawn = found["culled"] == 0
    assert drawn.sum() > 300
    screen = found["screen"][drawn]
    np.testing.assert_allclose(screen[:, :2], means[0].numpy()[drawn], rtol=0, atol=1e-3)
    np.testing.assert_allclose(screen[:, 2:5], conics[0].numpy()[drawn], rtol=1e-4, atol=1e-4)
    wanted = depths[0].numpy()
    if model == "fisheye":
        # Beyond a quarter turn from the axis z, by which gsplat goes, is no distance.
        wanted = np.linalg.norm(values["means"] - camera.center, axis=1)
    np.testing.assert_allclose(found["depths"][drawn], wanted[drawn], rtol=1e-5)
    np.testing.assert_allclose(
        screen[:, 5] / values["opacities"][drawn],
        np.maximum(kept[0].numpy()[drawn], 0.005),
        rtol=1e-3,
        atol=1e-5,
    )
    # Its torch code knows no opacity, which can only make an extent smaller.
    assert (found["radii"][drawn] <= radii[0].numpy()[drawn]).all()


def test_gsplat_shades_alike(device):
    values = random_splats(300, coefficients=25)
    directions = torch.tensor(values["means"] - Kind().camera.center)
    peer = gsplat._spherical_harmonics(4, directions, torch.tensor(values["sh"]).double())
    splats = upload(device, values, Kind())
    projected = project(device, splats, Kind().camera, SplatSettings())
    colors = device.get(shade(device, splats.means, splats.sh, Kind().camera, projected.culled))
    drawn = device.get(projected.culled) == 0
    wanted = np.maximum(peer.numpy() + 0.5, 0)
    np.testing.assert_allclose(colors[drawn], wanted[drawn], rtol=1e-5, atol=1e-5)
