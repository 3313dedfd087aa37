"""The benchmark of the footprints, at its smallest."""

from __future__ import annotations

import json

from rift_cl.operators import FOOTPRINTS


def test_every_footprint_is_in_every_table(tool, tmp_path, monkeypatch, capsys):
    bench = tool("bench_footprints")
    record, page = tmp_path / "footprints.json", tmp_path / "footprints.md"
    sizes = ["--cost", "32x24", "--size", "64", "--views", "30", "--rounds", "2"]
    command = ["bench_footprints", "--json", str(record), "--markdown", str(page), *sizes]
    monkeypatch.setattr("sys.argv", command)
    assert bench.main() == 0
    found, shown = json.loads(record.read_text()), capsys.readouterr().out
    for way in ("forward", "backward"):
        assert {name: len(runs) for name, runs in found["seconds"][way].items()} == dict.fromkeys(
            FOOTPRINTS, 2
        )
    strip, linear = (
        next(f for f in found["flatness"] if (f["footprint"], f["spacing"]) == (name, 1))
        for name in ("strip", "linear")
    )
    assert strip["by_views"]["360"][1] < 1.5e-3 < linear["by_views"]["360"][1]
    assert max(found["phases"].values()) < 0.02
    assert all(20 < head[kind] < 40 for head in found["head"] for kind in ("fbp", "cgls"))
    for name in FOOTPRINTS:
        assert page.read_text().count(f"| {name} |") == 8
        assert name in shown
