"""What functions say of a command's options: as keywords, which their callers give."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.python_words import in_python
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.errors import OutputError


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ("--overwrite begins anew", "overwrite=True begins anew"),
        ("name another (--out)", "name another (out)"),
        ("take all (--center, --no-beam-blur)", "take all (center, --no-beam-blur)"),
        ("--method tv", 'method="tv"'),
        ("add --cluster local:1 to it", 'add cluster="local:1" to it'),
        ("--rows 0 64, or --pitch 0.65", "rows=(0, 64), or pitch=0.65"),
        ("--window LOW HIGH", "window=(LOW, HIGH)"),
        ("name it with theta= (--theta)", "name it with theta="),
        ("'rift reconstruct SCAN --overwrite' does", "'rift reconstruct SCAN --overwrite' does"),
        ("pip install --upgrade av", "pip install --upgrade av"),
    ],
)
def test_options_are_keywords_and_commands_stay(said, wanted):
    assert in_python(said, ReconstructSettings) == wanted


def test_errors_and_notes_of_functions_name_keywords(tmp_path):
    angles = np.arange(12) * np.pi / 12
    sinogram = rift.phantom.shepp_logan_sinogram(rift.Grid((16, 16)), rift.Parallel(angles, 16))
    np.savez(tmp_path / "scan.npz", sinogram=sinogram, angles=angles)
    made = rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / "out", center=7.5)
    assert "(pitch)" in " ".join(made.notes)
    with pytest.raises(OutputError, match="overwrite=True") as error:
        rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / "out", center=7.5)
    assert "--" not in str(error.value)
    again = rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / "out", center=7.5, resume=True)
    assert "--" not in " ".join((*made.notes, *again.notes))
