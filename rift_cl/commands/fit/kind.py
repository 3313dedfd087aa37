"""Which of its two commands ``rift fit CAPTURE`` means: by what the capture is."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

from rift_cl.commands.run_folder.saved_settings import named_config
from rift_cl.io.captures.other_cameras import other_program
from rift_cl.io.scans.formats import is_scan_file
from rift_cl.json_parsing import parse_json


def kind_of_fit(arguments: Sequence[str]) -> Literal["photos", "xray"]:
    """X-rays where a scan file is given, or the config.json of such a fit; else photographs.

    Args:
        arguments: of the command line, after ``fit``.
    """
    config = named_config(arguments)
    if config is not None:
        with suppress(OSError, ValueError, LookupError, TypeError):
            record = parse_json(config.read_text(encoding="utf-8"))
            return "xray" if record["job"] == "fit xray" else "photos"
    # What follows an option may be its value, so that the others are looked at first.
    words = [word for word in arguments if not word.startswith("-")]
    given = [word for word in words if _free(word, arguments)] or words
    return "xray" if any(is_scan(Path(word)) for word in given) else "photos"


def is_scan(path: Path) -> bool:
    """Whether a file is a scan, and not cameras that another program left in a file of its kind."""
    return is_scan_file(path) and other_program(path) is None


def _free(word: str, arguments: Sequence[str]) -> bool:
    place = arguments.index(word)
    return place == 0 or not arguments[place - 1].startswith("-")
