"""Python files of a person's own filters, losses, bases, strategies and readers, for a shell.

A registry holds for one process. ``rift --load FILE.py COMMAND`` runs the file before the command,
and the environment variable ``RIFT_LOAD`` hands it on to processes that the command starts.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from rift_cl.errors import InputError

VARIABLE = "RIFT_LOAD"
# Before the name of the file, which may be that of a package.
_PREFIX = "rift_own_"
# Where a file that was run keeps its hash, and how much of that.
_DIGEST, _DIGITS = "__rift_digest__", 12


def load_parts(paths: Sequence[str] = ()) -> None:
    """Run files that register parts: those of ``RIFT_LOAD``, then others; each of them once.

    Args:
        paths: Python files, which ``RIFT_LOAD`` names from then on.

    Raises:
        InputError: there is no such file, it is not called ``.py``, or it fails.
    """
    named = [path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path]
    files = list(dict.fromkeys(Path(path).absolute() for path in (*named, *paths)))
    for file in files:
        _load(file)
    if files:
        os.environ[VARIABLE] = os.pathsep.join(map(str, files))


def loaded_parts() -> dict[str, str]:
    """The files that were run, by name, with the first digits of their SHA-256 at that time.

    A run is repeated, and gone on with, by the names of the parts that it used; these tell whether
    a name still means the same.
    """
    modules = [module for name, module in sorted(sys.modules.items()) if name.startswith(_PREFIX)]
    return {Path(str(module.__file__)).name: vars(module)[_DIGEST] for module in modules}


def decisive_parts() -> dict[str, str]:
    """The same, as settings on which the outcome of a run depends."""
    return {f"file of --load {name}": digest for name, digest in loaded_parts().items()}


def _load(file: Path) -> None:
    name = _PREFIX + file.stem
    loaded = sys.modules.get(name)
    if loaded is not None:
        if loaded.__file__ == str(file):
            return
        raise InputError(f"{file}: a file of this name was loaded already ({loaded.__file__})")
    if file.suffix != ".py" or not file.is_file():
        raise InputError(f"{file}: --load and {VARIABLE} want a Python file (.py), this is none")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    vars(module)[_DIGEST] = hashlib.sha256(file.read_bytes()).hexdigest()[:_DIGITS]
    # Classes of the file are found here by processes that are handed their objects.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if not isinstance(error, (Exception, SystemExit)):
            raise
        raise InputError(f"{file}: {_where(error, file)}{_said(error)}") from error


def _where(error: BaseException, file: Path) -> str:
    """The last line of the file that was at work."""
    if isinstance(error, SyntaxError) and error.filename == str(file):
        return f"line {error.lineno}: "
    lines = [at.lineno for at in traceback.extract_tb(error.__traceback__)
             if at.filename == str(file)]  # fmt: skip
    return f"line {lines[-1]}: " if lines else ""


def _said(error: BaseException) -> str:
    said = (error.msg if isinstance(error, SyntaxError) else str(error)).splitlines()
    kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
    return f"{kind}{said[0]}" if said else type(error).__name__
