"""Two runs into one folder at a time: the second is told, and the first loses nothing."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import OutputError
from rift_cl.io import folder_lock
from rift_cl.io.folder_lock import LOCK_NAME, keep, let_go

OTHER = """
import sys
from pathlib import Path
from rift_cl.io.folder_lock import keep
keep(Path(sys.argv[1]))
print("kept", flush=True)
sys.stdin.read()
"""


def test_a_folder_is_kept_from_other_processes_until_they_end(tmp_path):
    other = subprocess.Popen(
        [sys.executable, "-c", OTHER, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert other.stdout.readline() == "kept\n"
        with pytest.raises(OutputError, match=f"process {other.pid} on .* is writing here"):
            RunFolder(tmp_path, "plan").make()
        assert [path.name for path in tmp_path.iterdir()] == [LOCK_NAME]
    finally:
        other.kill()
        other.communicate()
    # What a killed process left keeps nobody out.
    folder = RunFolder(tmp_path, "plan")
    folder.make()
    folder.release()
    assert [path.name for path in tmp_path.iterdir()] == ["config.json"]


def test_a_process_does_not_keep_a_folder_from_itself(tmp_path):
    keep(tmp_path)
    keep(tmp_path)
    let_go(tmp_path)
    let_go(tmp_path)
    assert not list(tmp_path.iterdir())


def test_what_another_run_wrote_meanwhile_is_not_written_over(tmp_path):
    early, late = RunFolder(tmp_path, "plan"), RunFolder(tmp_path, "plan")
    early.make()
    early.release()
    with pytest.raises(OutputError, match="meanwhile"):
        late.make()
    late.release()


def test_a_run_that_is_gone_meanwhile_is_replaced(tmp_path):
    """As the demo's second run removes the fits of its first."""
    RunFolder(tmp_path, "plan").mark()
    again = RunFolder(tmp_path, "plan", overwrite=True)
    (tmp_path / "config.json").unlink()
    again.make()
    again.release()
    assert (tmp_path / "config.json").is_file()


def test_windows_locks_a_byte_behind_the_note(tmp_path, monkeypatch):
    """By a stand-in for its module, with which nobody may open the file to remove it."""
    locked, removed = [], []

    def locking(number, mode, count):
        if locked:
            raise PermissionError(13, "Permission denied")
        locked.append((os.lseek(number, 0, os.SEEK_CUR), mode, count))

    def unlink(path):
        # Closed by then.
        removed.append(all(handle.closed for handle in opened))
        remove(path)

    opened, usual, remove = [], type(tmp_path).open, type(tmp_path).unlink
    monkeypatch.setattr(
        type(tmp_path),
        "open",
        lambda *given, **more: opened.append(usual(*given, **more)) or opened[-1],
    )
    monkeypatch.setattr(type(tmp_path), "unlink", unlink)
    monkeypatch.setattr(folder_lock, "fcntl", None)
    monkeypatch.setattr(folder_lock, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    keep(tmp_path)
    note = (tmp_path / LOCK_NAME).read_bytes()
    assert note == f"process {os.getpid()} on {folder_lock.socket.gethostname()}".encode()
    assert locked == [(folder_lock._LOCKED_BYTE, 2, 1)] and len(note) < folder_lock._LOCKED_BYTE
    held = dict(folder_lock._held)
    folder_lock._held.clear()
    # As another process sees it.
    with pytest.raises(OutputError, match=f"process {os.getpid()} on .* is writing here"):
        keep(tmp_path)
    folder_lock._held.update(held)
    let_go(tmp_path)
    assert removed == [True] and not list(tmp_path.iterdir())
