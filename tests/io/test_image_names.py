"""Images are opened by their names in every locale, and by names that are no text."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.errors import RiftError
from rift_cl.io import read_image
from rift_cl.io.images.image import write_png

ROUND_TRIP = """
import sys
from pathlib import Path
import numpy as np
from rift_cl.io import read_image
from rift_cl.io.images.image import write_png
folder = next(path for path in Path(sys.argv[1]).iterdir())
picture = read_image(folder / "in.png")
write_png(folder / "out.png", picture)
assert read_image(folder / "out.png").shape == picture.shape
"""


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
def test_a_folder_with_an_umlaut_where_the_locale_knows_none(tmp_path: Path, locale: str) -> None:
    folder = tmp_path / "größe"
    folder.mkdir()
    write_png(folder / "in.png", np.full((4, 5, 3), 0.5, np.float32))
    surroundings = {"LC_ALL": locale, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-c", ROUND_TRIP, str(tmp_path)]
    done = subprocess.run(command, env=os.environ | surroundings, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode("utf-8", "replace")


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
def test_a_name_that_is_not_utf_8_is_told(tmp_path: Path) -> None:
    write_png(tmp_path / "in.png", np.full((4, 5, 3), 0.5, np.float32))
    path = Path(os.fsdecode(os.fsencode(tmp_path / "b") + b"\xff.png"))
    (tmp_path / "in.png").rename(path)
    with pytest.raises(RiftError, match="UTF-8"):
        read_image(path)
