"""Folders, variables and terminals as they come: each ends in a sentence or does no harm."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import pytest
import tiff_files as made

from rift_cl.cl import discovery
from rift_cl.commands.cli import main
from rift_cl.commands.console_table import print_table
from rift_cl.commands.runner import exit_status
from rift_cl.errors import InputError, NoDeviceError
from rift_cl.io import open_scan

OUTPUT = 5


def test_an_output_that_is_links_in_a_circle_is_told(scan, tmp_path, capsys):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    words = ["reconstruct", str(scan.counts), "--center", "45", "--out", str(tmp_path / "a")]
    assert main(words) == OUTPUT
    assert f"{tmp_path / 'a'}: cannot be written" in capsys.readouterr().err


def test_a_geometry_that_is_a_pipe_is_there(scan, tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(InputError, match=r"pipe\.json.* is no file"):
        open_scan(scan.counts, geometry=str(tmp_path / "pipe.json"))


def test_a_frame_that_is_a_pipe_is_there(tmp_path):
    folder = made.write_series(tmp_path / "scan", "proj_{:04}.tif", made.frames(8))
    (folder / "proj_0003.tif").unlink()
    os.mkfifo(folder / "proj_0003.tif")
    with pytest.raises(InputError, match=r"proj_0003\.tif.* is no file"):
        open_scan(folder)


def test_a_variable_that_hides_devices_is_named(monkeypatch):
    monkeypatch.setattr(discovery, "devices", list)
    monkeypatch.setenv("POCL_DEVICES", "none")
    with pytest.raises(NoDeviceError, match="POCL_DEVICES=none"):
        discovery.open_device()


def test_a_terminal_of_no_columns_shows_tables(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "0")
    print_table(("what", "value"), [("psnr", 31.5)])
    assert "31.5" in capsys.readouterr().out


def test_a_tilde_that_no_shell_expanded_is_the_home(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    assert main(["render", "~/none.ply", "--out=~/a"]) == 3
    assert str(tmp_path / "home" / "none.ply") in capsys.readouterr().err
    assert not Path("~").exists()


def test_what_matplotlib_says_of_its_folders_is_not_shown():
    log = logging.getLogger("matplotlib.font_manager")
    assert exit_status(lambda: int(log.isEnabledFor(logging.WARNING))) == 0
    assert exit_status(lambda: int(log.isEnabledFor(logging.ERROR))) == 1
