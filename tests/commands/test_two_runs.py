"""Two runs into one folder at a time: the second is told, and the first loses nothing."""

import subprocess
import sys

import pytest

from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import OutputError
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
