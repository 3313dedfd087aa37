"""Debian packages unpacked into a folder, so that a driver is tried without installing it.

What is installed stays as it is: other programs see no new OpenCL device. Packages may be those
of another suite than the system's, with newer drivers: they come with all that they need, the C
library included, and Python runs on that (``python_under``), as programs do on a newer one.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_NO = ("recommends", "suggests", "conflicts", "breaks", "replaces", "enhances")


class UnpackError(RuntimeError):
    """A package cannot be had; its text says why."""


def unpack(package: str, folder: Path, suite: str = "") -> Path:
    """Unpack a package, and what it needs and is not installed, unless that was done before.

    Args:
        package: its name.
        folder: for the folder with the package's files, which is returned.
        suite: of Debian, such as trixie; the system's own if empty. Of another one everything is
            unpacked that the package needs.

    Raises:
        UnpackError: there is no apt here, or it does not know or cannot load the package.
    """
    root = folder / suite / package
    done = root / "unpacked"
    if done.is_file():
        return root
    archives = root / "archives"
    archives.mkdir(parents=True, exist_ok=True)
    apt = _other_suite(suite, folder / suite) if suite else []
    options = (f"--no-{relation}" for relation in _NO)
    listed = _said(["apt-cache", "depends", "--recurse", *options, *apt, package], archives)
    names = {line.strip() for line in listed.splitlines() if line[:1].isalnum()}
    wanted = sorted(name for name in names if suite or name == package or not _installed(name))
    _said(["apt-get", "download", "-qq", *apt, *wanted], archives)
    for archive in sorted(archives.glob("*.deb")):
        _said(["dpkg", "-x", str(archive), str(root)], archives)
    done.touch()
    return root


def library_folders(root: Path) -> list[str]:
    """The folders of unpacked packages that hold shared libraries."""
    return sorted({str(path.parent) for path in root.rglob("*.so*")})


def python_under(root: Path) -> Path:
    """A program that is this Python on the C library in ``root``; its packages are ``sys.path``.

    Children that it starts by ``sys.executable`` run there as well, other programs do not.

    Raises:
        UnpackError: no C library was unpacked there.
    """
    loaders = sorted(root.rglob("ld-linux*.so.*"))
    if not loaders:
        raise UnpackError(f"no C library was unpacked into {root}")
    program = root / "python"
    libraries = os.pathsep.join(library_folders(root))
    words = [loaders[0], "--argv0", program, "--library-path", libraries]
    words.append(Path(sys.executable).resolve())
    quoted = " ".join(f"'{word}'" for word in words)
    program.write_text(f'#!/bin/sh\nexec {quoted} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program


def _other_suite(suite: str, folder: Path) -> list[str]:
    """Options by which apt sees another suite alone, from where it has its packages now."""
    (folder / "lists" / "partial").mkdir(parents=True, exist_ok=True)
    source = folder / "suite.list"
    settings = {
        "Dir::State::lists": folder / "lists",
        "Dir::State::status": "/dev/null",
        "Dir::Cache": folder / "cache",
        "Dir::Etc::sourcelist": source,
        "Dir::Etc::sourceparts": "/dev/null",
    }
    options = [word for name, value in settings.items() for word in ("-o", f"{name}={value}")]
    if not source.is_file():
        known = _said(["apt-get", "indextargets", "--format", "$(REPO_URI)"], folder).split()
        places = sorted({uri for uri in known if "security" not in uri})
        if not places:
            raise UnpackError("apt knows no place with packages")
        source.write_text(f"deb {places[0]} {suite} main\n", encoding="utf-8")
        try:
            _said(["apt-get", "update", "-qq", *options], folder)
        except UnpackError:
            source.unlink()
            raise
    return options


def _installed(name: str) -> bool:
    command = ["dpkg-query", "-W", "-f", "${db:Status-Status}", name]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    return found.stdout.startswith("installed")


def _said(command: list[str], folder: Path) -> str:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise UnpackError(f"{command[0]} is not here: this needs Debian or Ubuntu") from error
    if done.returncode:
        raise UnpackError(f"{' '.join(command[:3])}: {done.stderr.strip().splitlines()[-1]}")
    return done.stdout
