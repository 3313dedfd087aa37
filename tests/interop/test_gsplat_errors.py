"""Arguments of gsplat's ``rasterization`` that make no sense, or that we do not support."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import DTypeError, InputError, ShapeError

torch = pytest.importorskip("torch", reason="torch is not installed")
from test_gsplat_rasterization import CAMERAS, draw, scene  # noqa: E402 - needs torch

pytestmark = pytest.mark.once


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"render_mode": "DEPTH"}, "render_mode is 'DEPTH'"),
        ({"rasterize_mode": "sharp"}, "rasterize_mode is 'sharp'"),
        ({"camera_model": "ftheta"}, "model is 'ftheta'"),
        ({"sparse_grad": True}, "sparse_grad is not supported"),
        ({"distributed": True}, "distributed is not supported"),
        ({"with_ut": True}, "with_ut"),
        ({"radial_coeffs": np.zeros((3, 6))}, "radial_coeffs"),
        ({"rolling_shutter": "ROLLING_TOP_TO_BOTTOM"}, "rolling_shutter"),
        ({"tile_size": 12}, "tile is 12"),
        ({"near_plane": -1.0}, "near is -1"),
        ({"eps2d": -0.1}, "eps2d"),
        ({"alpha_cap": 1.5}, "alpha_cap"),
    ],
)
def test_options_without_a_meaning_are_named(device, options, words):
    with pytest.raises(InputError, match=words):
        draw(device, scene(), **options)


def test_gsplats_name_for_no_rolling_shutter_passes(device):
    draw(device, scene(), rolling_shutter="RollingShutterType.GLOBAL")


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"means": lambda t: t[:, :2]}, ShapeError, r"means has shape \(70, 2\)"),
        ({"means": lambda t: t[0, 0]}, ShapeError, "means has shape"),
        ({"quats": lambda t: t[:-1]}, ShapeError, r"quats has shape \(69, 4\)"),
        ({"scales": lambda t: t.double()}, DTypeError, "scales"),
        ({"opacities": lambda t: t[:, None]}, ShapeError, "opacities"),
        ({"viewmats": lambda t: t[0]}, ShapeError, "viewmats has shape"),
        ({"Ks": lambda t: t[:2]}, ShapeError, "Ks has shape"),
        ({"colors": lambda t: t[:, :9]}, ShapeError, "9 coefficients, sh_degree 3 wants 16"),
        ({"colors": lambda t: t[0]}, ShapeError, "colors has shape"),
        ({"viewmats": lambda t: t * float("nan")}, InputError, "view"),
        ({"Ks": lambda t: 0 * t}, InputError, "focal lengths"),
        ({"width": lambda _: 0}, ShapeError, "size"),
        ({"colors": lambda t: t.numpy()}, DTypeError, "colors is a ndarray"),
    ],
)
def test_tensors_that_do_not_fit_are_named(device, changes, error, words):
    given = scene()
    given |= {name: change(given[name]) for name, change in changes.items()}
    with pytest.raises(error, match=words):
        draw(device, given, sh_degree=3)


def test_backgrounds_must_fit(device):
    with pytest.raises(ShapeError, match=r"backgrounds has shape \(3, 4\)"):
        draw(device, scene(), backgrounds=torch.zeros(CAMERAS, 4))
