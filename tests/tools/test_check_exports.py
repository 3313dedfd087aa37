"""``tools/check_exports.py`` reads exports back with other people's programs, and says how well."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene


def test_each_format_comes_back_as_well_as_it_can(tool, tmp_path, capsys):
    for name in ("gsply", "imagecodecs", "pygltflib", "plyfile", "viser", "zstandard", "msgspec"):
        pytest.importorskip(name)
    check, random = tool("check_exports"), np.random.default_rng(0)
    fit = tmp_path / "fit"
    fit.mkdir()
    SplatScene(
        means=random.normal(size=(400, 3)),
        log_scales=random.uniform(-5, -2, (400, 3)),
        quats=random.normal(size=(400, 4)),
        logit_opacities=random.normal(size=400),
        sh=random.normal(0, 0.2, (400, 16, 3)),
    ).save(fit / "scene.ply")
    write_json(fit / "config.json", {"job": "fit photos", "settings": {}})
    check.main(check.Options(fit, tmp_path / "out", tmp_path / "none"))
    lines = capsys.readouterr().out.split("\n")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    found = {(row[0], row[2]): row[3:8] for row in rows if len(row) == 11}
    bounds = {
        ("ply", "plyfile"): (0, 0, 0, 0, 0),
        ("glb", "pygltflib"): (0, 1e-5, 0.01, 1e-6, 0),
        ("spz", "gsply"): (1e-5, 0.032, 0.3, 0.003, 0.004),
        ("sog", "gsply"): (1e-3, 0.1, 1, 0.003, 0.05),
        ("compressed-ply", "gsply"): (0.01, 0.01, 0.3, 0.003, 0.01),
    }
    for key, most in bounds.items():
        assert all(float(cell) <= bound for cell, bound in zip(found[key], most, strict=True))
    assert sum("not installed" in row[-1] for row in rows if row) == 3
