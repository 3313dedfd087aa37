"""Do the smallest versions that pyproject.toml declares work?

    python tools/try_minimums.py --folder /tmp/minimums -- tests/cl tests/test_import.py

Makes a virtual environment in which every dependency of the package has exactly its declared
minimum (that of an extra's with ``--extras``), with the newest tools for tests, and runs the short
selection of tests (``pytest -m plain``) in it; without arguments all of them. Prints what was
installed. Ends with pytest's status, or 1 where the versions cannot be installed together.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from packaging.requirements import Requirement
from tyro.conf import Positional

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_ROOT = Path(__file__).resolve().parents[1]
_OWN = "rift-cl"


@dataclass(frozen=True)
class Options:
    """Install the smallest versions that are declared, and run the tests with them.

    Args:
        tests: files and folders of tests; all if none are named.
        folder: where the environment is made, and used again; a temporary one if not given.
        extras: extras whose minimums are installed as well.
        instead: versions to try in place of the declared ones, such as zarr==2.18.2.
    """

    tests: Annotated[tuple[str, ...], Positional] = ()
    folder: Path | None = None
    extras: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()


def main(options: Options) -> int:
    """Make the environment, run the tests, and return the exit status."""
    pins = minimums(declared(options.extras), options.instead)
    with tempfile.TemporaryDirectory(prefix="rift-cl-minimums-") as temporary:
        folder = options.folder or Path(temporary)
        if not (folder / "bin").exists():
            venv.create(folder, with_pip=True)
        python = str(folder / "bin" / "python")
        wanted = [*pins, *tools_of_tests()]
        print("\n".join(pins), flush=True)
        install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        if subprocess.run([*install, *wanted], check=False).returncode:
            print("these versions cannot be installed together")
            return 1
        environment = {**os.environ, "PYTHONPATH": str(_ROOT)}
        # Old packages use newer ones as these no longer like.
        quiet = ["-W", "ignore::DeprecationWarning"]
        command = [python, "-m", "pytest", "-q", "-m", "plain", *quiet, *options.tests]
        return subprocess.run(command, cwd=_ROOT, env=environment, check=False).returncode


def declared(extras: Iterable[str] = ()) -> list[Requirement]:
    """The dependencies that the project declares for this system, those of extras after its own."""
    project = _project()
    groups = [project["dependencies"], *(project["optional-dependencies"][e] for e in extras)]
    listed = [Requirement(text) for group in groups for text in group]
    return [each for each in listed if each.marker is None or each.marker.evaluate()]


def minimums(requirements: Iterable[Requirement], instead: Iterable[str] = ()) -> list[str]:
    """Each requirement as exactly its minimum.

    Args:
        requirements: those that are declared.
        instead: other versions of some, as NAME==VERSION.

    Raises:
        ValueError: one declares no minimum.
    """
    others = {Requirement(text).name: Requirement(text).specifier for text in instead}
    pins = []
    for each in requirements:
        least = [part.version for part in each.specifier if part.operator == ">="]
        if not least:
            raise ValueError(f"{each} declares no smallest version")
        extras = f"[{','.join(sorted(each.extras))}]" if each.extras else ""
        # "2.18" stands for 2.18.0 as well as for what is not pinned further.
        pins.append(f"{each.name}{extras}{others.get(each.name, f'=={least[0]}')}")
    return pins


def tools_of_tests() -> list[str]:
    """What the tests need beside the package's own dependencies."""
    listed = _project()["optional-dependencies"]["test"]
    return [text for text in listed if not re.match(_OWN, text)]


def _project() -> dict[str, Any]:
    content = (_ROOT / "pyproject.toml").read_text(encoding="utf-8")
    project: dict[str, Any] = tomllib.loads(content)["project"]
    return project


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
