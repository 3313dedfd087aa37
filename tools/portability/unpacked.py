"""Debian packages unpacked into a folder, so that a driver is tried without installing it.

What is installed stays as it is: other programs see no new OpenCL device.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

_NO = ("recommends", "suggests", "conflicts", "breaks", "replaces", "enhances")


class UnpackError(RuntimeError):
    """A package cannot be had; its text says why."""


def unpack(package: str, folder: Path) -> Path:
    """Unpack a package, and what it needs and is not installed, unless that was done before.

    Args:
        package: its name.
        folder: for the folder with the package's files, which is returned.

    Raises:
        UnpackError: there is no apt here, or it does not know or cannot load the package.
    """
    root, done = folder / package, folder / package / "unpacked"
    if done.is_file():
        return root
    archives = root / "archives"
    archives.mkdir(parents=True, exist_ok=True)
    options = (f"--no-{relation}" for relation in _NO)
    listed = _said(["apt-cache", "depends", "--recurse", *options, package], archives)
    names = {line.strip() for line in listed.splitlines() if line[:1].isalnum()}
    wanted = sorted(name for name in names if name == package or not _installed(name))
    _said(["apt-get", "download", "-qq", *wanted], archives)
    for archive in sorted(archives.glob("*.deb")):
        _said(["dpkg", "-x", str(archive), str(root)], archives)
    done.touch()
    return root


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
