"""Splats are computed several at a time: none of them knows where it stands among the others.

Where their number is no multiple of eight, the last ones are fewer than eight, and the last run of
splats is shorter; the numbers of a splat must have the same bits there as amid many others.
"""

from __future__ import annotations

import numpy as np
import pytest
from lobe_scenes import Lobes, random_lobes, seen, seen_grad
from projection_scenes import KINDS, random_splats, upload

from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import project, project_grad
from rift_cl.splat.raster import ScreenSplats, packed

COUNTS = (1, 7, 8, 9, 65)


def everything(device, values, kind, sums):
    """All that is computed of each splat, by name: (N, ..) host arrays."""
    splats, camera = upload(device, values, kind), kind.camera
    seen = project(device, splats, camera, kind.settings)
    features = shade(device, splats.means, splats.sh, camera, seen.culled)
    gradients = project_grad(seen, device.array(sums))
    given = (device, splats.means, splats.sh, camera)
    by_sh = shade_grad(*given, features=features, gradients=gradients)
    found = {"screen": seen.screen, "depths": seen.depths, "boxes": seen.boxes, "by sh": by_sh}
    found |= {"culled": seen.culled, "colors": features}
    names = ("means", "quats", "scales", "covars", "opacities", "features", "means2d")
    found |= {f"by {name}": getattr(gradients, name) for name in names}
    found["record"] = packed(device, ScreenSplats(seen.screen, features, None)).records
    return {name: device.get(array) for name, array in found.items() if array is not None}


def same(found, expected):
    """Whether numbers have the same bits; a zero may have either sign."""
    return np.array_equal(found, expected, equal_nan=True)


@pytest.mark.parametrize("kind", ["pinhole", "fisheye antialiased covariances", "lens antialiased"])
def test_splats_have_the_same_bits_in_any_company(device, kind):
    values = random_splats(200)
    # A splat that is no number must not show in those beside it.
    values["means"][3], values["sh"][70, 2, 1], values["scales"][130] = np.nan, np.inf, -1
    sums = np.random.default_rng(3).standard_normal((200, 9)).astype(np.float32)
    whole = everything(device, values, KINDS[kind], sums)
    assert (whole["culled"] == 0).sum() > 60
    for count in COUNTS:
        some = {name: value[:count] for name, value in values.items()}
        found = everything(device, some, KINDS[kind], sums[:count])
        for name, array in found.items():
            drawn = whole["culled"][:count] == 0 if name == "record" else slice(None)
            assert same(array[drawn], whole[name][:count][drawn]), (name, count)


@pytest.mark.parametrize("kind, count", [("asg", 4), ("lg", 9), ("sg", 4), ("hg", 8)])
def test_so_have_splats_with_lobes(device, kind, count):
    given = random_lobes(kind, count)
    given.lobes[3, 0], given.linear[70, 0, 1] = np.nan, np.inf
    incoming = np.random.default_rng(3).standard_normal((200, 3)).astype(np.float32)
    colors, whole = device.get(seen(device, given)), seen_grad(device, given, incoming)
    for some in (1, 7, 9, 65):
        few = Lobes(kind, given.means[:some], given.linear[:some], given.lobes[:some])
        assert same(device.get(seen(device, few)), colors[:some])
        found = seen_grad(device, few, incoming[:some])
        for name in ("linear", "lobes", "means"):
            assert same(found[name], whole[name][:some]), (name, some)


def test_work_items_without_a_splat_write_nothing(device):
    rows = {f"inverse_{axis}": np.full(4, np.inf, np.float32) for axis in "xyz"}
    parts = device.zeros((64, 16))
    device.launch(
        "splat_shade_grad",
        (1,),
        **{name: device.array(np.ones((1, 3))) for name in ("means", "features", "grad_features")},
        **{name: device.array(np.ones((1, 1, 3))) for name in ("sh", "grad_sh")},
        **rows,
        count=1,
        grad_means=device.zeros((1, 3)),
        camera_parts=parts,
        RUN=device.traits.run,
        STRIDE=3,
        COEFFICIENTS=1,
        CAMERA_GRADIENT=True,
    )
    assert np.isnan(device.get(parts)[0]).any()
    assert not device.get(parts)[1:].any()
