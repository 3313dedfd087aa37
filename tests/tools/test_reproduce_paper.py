"""The paper's figures: computed to JSON, drawn from JSON alone."""

import json
import subprocess
import sys
from pathlib import Path

TOOL = Path(__file__).parents[2] / "tools" / "reproduce_paper.py"


def run(*arguments):
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)


def test_quick_then_report_alone(tmp_path):
    result = run("--quick", "--out", tmp_path)
    assert result.returncode == 0, result.stderr
    for number, count in (("05", 5), ("06", 7)):
        record = json.loads((tmp_path / f"figure_{number}.json").read_text())
        assert record["environment"]["device"]
        assert len(record["result"]["views"]) == count
    page = (tmp_path / "report.html").read_text()
    (tmp_path / "report.html").unlink()
    assert run("--report-only", "--out", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_text() == page


def test_the_papers_claim_holds(tmp_path):
    assert run("--only", "figure_06", "--out", tmp_path).returncode == 0
    rows = json.loads((tmp_path / "figure_06.json").read_text())["result"]["views"]
    many = [row for row in rows if row["count"] >= 20]
    unfiltered = [row["psnr_unfiltered"] for row in many]
    filtered = [row["psnr_filtered"] for row in many]
    assert max(unfiltered) - min(unfiltered) < 0.1
    assert filtered[-1] > filtered[0] + 10


def test_bad_arguments(tmp_path):
    result = run("--only", "figure_99", "--out", tmp_path / "out")
    assert result.returncode == 2
    assert "figure_99" in result.stderr
    assert not (tmp_path / "out").exists()
