"""Files of a person's own parts, which ``rift --load`` runs before a command."""

import os
import sys

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.errors import CheckpointError, InputError
from rift_cl.io.volumes import read_volume
from rift_cl.operators import FILTERS
from rift_cl.own_parts import VARIABLE, load_parts, loaded_parts

OWN = """
import rift_cl as rift

def parzen(frequency):
    return frequency * (1 - frequency) ** 2

rift.register_filter("parzen", parzen)
"""


@pytest.fixture(autouse=True)
def _forget(monkeypatch):
    """Nothing that a test loads stays."""
    monkeypatch.setenv(VARIABLE, "")
    modules, filters = set(sys.modules), set(FILTERS)
    yield
    for name in {name for name in sys.modules if name.startswith("rift_own_")} - modules:
        del sys.modules[name]
    for name in set(FILTERS) - filters:
        FILTERS.remove(name)


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "parzen.py"
    path.write_text(OWN)
    return path


@pytest.fixture
def scan(tmp_path):
    angles = np.linspace(0, np.pi, 24, endpoint=False)
    geometry = rift.Parallel(angles, bins=48)
    sinogram = rift.phantom.shepp_logan_sinogram(rift.Grid((32, 32)), geometry)
    path = tmp_path / "scan.npz"
    np.savez(path, sinogram=sinogram, angles=angles)
    return path


@pytest.mark.full
def test_a_filter_of_ones_own_works_in_a_shell_as_in_python(own, scan, tmp_path, capsys):
    words = ["reconstruct", str(scan), "--center", "23.5", "--filter", "parzen", "--out"]
    assert main([*words, str(tmp_path / "no")]) == InputError.exit_status
    assert "rift --load FILE.py" in capsys.readouterr().err
    assert main(["--load", str(own), *words, str(tmp_path / "a"), "--quiet"]) == 0
    settings = {"filter": "parzen", "center": 23.5}
    rift.reconstruct_scan(scan, tmp_path / "b", **settings)
    volume = read_volume(tmp_path / "a/slices")
    assert np.array_equal(volume, read_volume(tmp_path / "b/slices"))
    rift.reconstruct_scan(scan, tmp_path / "c", **{**settings, "filter": "ram-lak"})
    assert np.abs(volume - read_volume(tmp_path / "c/slices")).max() > 0.01
    config = str(tmp_path / "a/config.json")
    again = [f"--load={own}", "reconstruct", "--config", config, "--out", str(tmp_path / "d")]
    assert main([*again, "--quiet"]) == 0
    assert np.array_equal(volume, read_volume(tmp_path / "d/slices"))


def test_what_is_loaded_is_handed_on_and_run_once(own, monkeypatch):
    load_parts([str(own)])
    assert os.environ[VARIABLE] == str(own)
    load_parts()
    load_parts([str(own), str(own)])
    assert os.environ[VARIABLE] == str(own) and "parzen" in FILTERS


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import rift_cl\n1 / 0\n", "line 2: ZeroDivisionError: division by zero"),
        ("def f(:\n", "line 1: SyntaxError"),
        ("import no_such_package_at_all\n", "line 1: ModuleNotFoundError: No module named"),
        ("raise SystemExit\n", "line 1: SystemExit"),
        ("import rift_cl\nrift_cl.register_filter('hann', abs)\n", "line 2: a filter named 'hann'"),
    ],
)
def test_a_file_that_fails_is_told_in_one_sentence(tmp_path, capsys, text, said):
    path = tmp_path / "bad.py"
    path.write_text(text)
    for _ in range(2):
        assert main(["--load", str(path), "devices"]) == InputError.exit_status
        (told,) = capsys.readouterr().err.splitlines()
        assert told.startswith(f"rift: {path}: {said}"), told


@pytest.mark.parametrize("words", [["none.py"], ["scan.npz"], ["."], []])
def test_what_is_no_file_of_python_is_refused(scan, monkeypatch, capsys, words):
    monkeypatch.chdir(scan.parent)
    assert main(["--load", *words]) == InputError.exit_status
    (told,) = capsys.readouterr().err.splitlines()
    assert "Python file" in told


def test_two_files_of_one_name_are_not_taken_for_one(own, tmp_path, capsys):
    other = tmp_path / "other" / own.name
    other.parent.mkdir()
    other.write_text("")
    assert main(["--load", str(own), "--load", str(other), "devices"]) == InputError.exit_status
    assert "loaded already" in capsys.readouterr().err


@pytest.mark.full
@pytest.mark.filterwarnings("always:--config")
def test_a_part_that_was_changed_since_is_told(own, scan, tmp_path, capsys):
    """The name that a run is repeated by means another filter then."""
    words = ["reconstruct", str(scan), "--center", "23.5", "--filter", "parzen", "--quiet"]
    first, again = tmp_path / "a", tmp_path / "b"
    assert main(["--load", str(own), *words, "--out", str(first)]) == 0
    config = ["reconstruct", "--config", str(first / "config.json"), "--quiet"]
    assert main([*config, "--out", str(again)]) == 0
    assert "changed since" not in capsys.readouterr().err
    own.write_text(OWN.replace("** 2", "** 3"))
    # What is running has loaded the file as it was; the next process has it as it is.
    assert main([*config, "--out", str(tmp_path / "d")]) == 0
    assert "changed since" not in capsys.readouterr().err
    del sys.modules["rift_own_parzen"]
    FILTERS.remove("parzen")
    load_parts([str(own)])
    assert main([*config, "--out", str(tmp_path / "c")]) == 0
    said = capsys.readouterr().err
    assert "rift: warning: --config" in said and "parzen.py (--load) was changed since" in said
    before = ReconstructSettings(scan, first).decisive()
    assert before["file of --load parzen.py"] == loaded_parts()["parzen.py"]
    assert main([*words, "--out", str(first), "--resume"]) == CheckpointError.exit_status
    assert "file of --load parzen.py" in capsys.readouterr().err


def test_a_function_in_place_of_a_name_is_told_to_be_registered(tmp_path):
    with pytest.raises(InputError, match=r"filter is .*wanted a text: register it .* its name"):
        rift.reconstruct_scan(tmp_path / "scan.npz", filter=abs)
