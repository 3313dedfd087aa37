"""``tools/check_paganin.py`` prints errors of the thickness, which stay within a per cent."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_table_says_that_thickness_comes_back():
    command = [sys.executable, str(ROOT / "tools/check_paganin.py"), "--distances", "0.005", "0.02"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    rows = [line for line in done.stdout.splitlines() if line.startswith("| 0.")]
    assert len(rows) == 2
    for row in rows:
        errors = [float(value) for value in re.findall(r"(-?\+?[\d.]+)%", row)]
        assert len(errors) == 9
        assert max(abs(value) for value in errors[:6]) < 1 < errors[6]
