"""What a run reads, by its contents, so that one that goes on is known to go on with the same."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rift_cl.commands.options import named_file
from rift_cl.commands.run_folder.saved_settings import options_of
from rift_cl.io.file_content import Content
from rift_cl.own_parts import decisive_parts

# Settings that change nothing of what comes out.
FREE = (
    *("cluster", "config", "device", "dry_run", "out", "overwrite", "part_timeout", "resume"),
    "view",
)


def files_read(settings: Any) -> Iterator[Path]:
    """The files and folders that are there and that options of a run name."""
    yield from (path for _, path, _ in named_files(settings))


def input_contents(settings: Any, out: Path) -> dict[str, Any]:
    """What decides a run besides the values of its options.

    Args:
        settings: of the run.
        out: its folder, whose files are its own.

    Returns:
        By the options that name files, their contents (records of ``Content``), and by the files of
        ``--load`` their digests.

    Raises:
        InputError: a file cannot be read.
    """
    found: dict[str, Any] = decisive_parts()
    for name, path, part in named_files(settings):
        content = Content.of(files_of(path, Path(os.path.realpath(out))), path)
        # An option may name several.
        key = name if name not in found else f"{name} ({sum(k.startswith(name) for k in found)})"
        found[key] = {**content.record(), "words": content.words + part}
    return found


def files_of(named: Path, own: Path) -> tuple[Path, ...]:
    """The files of a path that an option names: those of a folder, and those behind an HDF5 file.

    Args:
        named: the file or folder.
        own: folder of the run, whose files are not counted.

    Raises:
        InputError: a file cannot be read.
    """
    # Imported when used: the help of commands reads no file.
    from rift_cl.io.hdf5_tree import files_behind

    if not named.is_dir():
        return files_behind(named)
    inner = (path for path in sorted(named.rglob("*")) if path.is_file())
    return tuple(path for path in inner if not path.resolve().is_relative_to(own))


def without_inputs(asked: Mapping[str, Any], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The values of options but for those whose files are known by their contents."""
    return {
        name: value
        for name, value in asked.items()
        if name not in FREE and Content.read(inputs.get(name)) is None
    }


def named_files(settings: Any) -> Iterator[tuple[str, Path, str]]:
    """Options that name files or folders that are there, these, and what of them is meant."""
    for option in options_of(settings):
        if option.name in FREE:
            continue
        several = option.value if isinstance(option.value, tuple) else (option.value,)
        for value in several:
            named = named_file(option.name, value)
            if named is not None:
                yield option.name, *named
