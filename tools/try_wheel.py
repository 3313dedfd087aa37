"""Build the wheel and the source distribution, look into them, and use them in empty environments.

    python tools/try_wheel.py
    python tools/try_wheel.py --pythons python3.10 python3.13 --sdist

The wheel must hold the package, its kernels and data, and nothing of tests and tools. In an
environment of its own for each Python it is installed with what it depends on, then ``rift
--version``, a small reconstruction and ``rift reconstruct`` of a scan must be right. With
``--sdist`` the source distribution is installed as well, in the first of them. Prints what the
parts weigh. ``build`` is needed: pip install build.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import tyro

ROOT = Path(__file__).parents[1]
OLDEST, NEWEST = 10, 14
# Folders of a checkout that have no place in what is installed.
_OUTSIDE = ("tests", "tools", "docs", "examples")
_MEGABYTE = 1e6
# What weighs less is not listed, in bytes.
_WORTH_LISTING = 5e6

SMOKE = """
import numpy as np, rift_cl as rift
grid, scan = rift.Grid((48, 48)), rift.Parallel(np.linspace(0, np.pi, 90, endpoint=False), 69)
A, head = rift.Projector(grid, scan), rift.phantom.shepp_logan(grid)
slice_ = rift.fbp(A, A(head))
assert rift.metrics.psnr(slice_, head, peak=1.0) > 20
np.savez("scan.npz", projections=A(head)[:, None], angles=scan.angles, kind="attenuation")
"""


@dataclass(frozen=True)
class Options:
    """What is tried.

    Args:
        pythons: interpreters; all from 3.10 on that are found if not given.
        sdist: whether the source distribution is installed too, in the first of them.
        keep: folder that the two files are left in.
    """

    pythons: tuple[str, ...] = ()
    sdist: bool = False
    keep: Path | None = None


def main(options: Options) -> int:
    """Build, look, install; the exit status says whether all held."""
    with tempfile.TemporaryDirectory(prefix="rift-wheel-") as name:
        folder = Path(name)
        wheel, sdist = built(folder / "dist")
        faults = [*wheel_faults(wheel), *sdist_faults(sdist)]
        for path in (wheel, sdist):
            print(f"{path.name}: {path.stat().st_size / _MEGABYTE:.2f} MB")
            if options.keep is not None:
                options.keep.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, options.keep)
        print_parts("unpacked", parts_of(wheel))
        pythons = options.pythons or tuple(pythons_there())
        for number, python in enumerate(pythons):
            for path in (wheel, sdist) if options.sdist and number == 0 else (wheel,):
                fault = tried(python, path, folder / f"{number}{path.suffix}")
                print(f"{python}, {path.suffix[1:]}: {fault or 'installed, reconstructs'}")
                faults += [fault] if fault else []
    for fault in faults:
        print(f"FAULT {fault}")
    return 1 if faults else 0


def built(folder: Path) -> tuple[Path, Path]:
    """The wheel and the source distribution of this checkout."""
    subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


def wheel_faults(wheel: Path) -> list[str]:
    """What is wrong with the files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    tops = {name.split("/")[0] for name in names}
    strange = [top for top in tops if top != "rift_cl" and not top.endswith(".dist-info")]
    wanted = [f"rift_cl/{path.relative_to(ROOT)}" for path in (ROOT / "kernels").rglob("*.[ch]*")]
    wanted += [str(path.relative_to(ROOT)) for path in (ROOT / "rift_cl").rglob("*.py")]
    missing = sorted(set(wanted) - set(names))
    return [
        *(f"{wheel.name} holds {top}" for top in strange),
        *(f"{wheel.name} lacks {name}" for name in missing[:3]),
        *(f"{wheel.name} holds {name}" for name in names if name.split("/")[1] in _OUTSIDE),
    ]


def sdist_faults(sdist: Path) -> list[str]:
    """What is missing from a source distribution, of which tests are a part."""
    with tarfile.open(sdist) as archive:
        tops = {name.split("/")[1] for name in archive.getnames() if "/" in name}
    wanted = ("rift_cl", "kernels", "tests", "tools", "docs", "LICENSE", "CHANGELOG.md")
    return [f"{sdist.name} lacks {name}" for name in wanted if name not in tops]


def parts_of(wheel: Path) -> Counter[str]:
    """Bytes of the parts of a wheel, unpacked."""
    parts: Counter[str] = Counter()
    with zipfile.ZipFile(wheel) as archive:
        for entry in archive.infolist():
            parts["/".join(entry.filename.split("/")[:2])] += entry.file_size
    return parts


def print_parts(title: str, parts: Counter[str], least: float = 0.2 * _MEGABYTE) -> None:
    """Print what the largest parts weigh."""
    print(f"{title}: {sum(parts.values()) / _MEGABYTE:.1f} MB")
    for name, size in parts.most_common():
        if size >= least:
            print(f"    {size / _MEGABYTE:7.1f} MB  {name}")


def pythons_there() -> Iterator[str]:
    """Interpreters from 3.10 on: on the path, or where pyenv and uv put theirs."""
    home = Path.home()
    for minor in range(OLDEST, NEWEST + 1):
        name = f"python3.{minor}"
        elsewhere = [
            *(home / ".pyenv" / "versions").glob(f"3.{minor}.*/bin/{name}"),
            *(home / ".local/share/uv/python").glob(f"cpython-3.{minor}.*/bin/{name}"),
        ]
        found = next(map(str, elsewhere), None) or shutil.which(name)
        if found is not None:
            yield found


def tried(python: str, path: Path, folder: Path) -> str:
    """Install a file in an empty environment and use it; what went wrong, or nothing."""
    place = folder / "bin"
    steps = [
        [python, "-m", "venv", str(folder)],
        [str(place / "pip"), "install", "--quiet", str(path)],
        [str(place / "rift"), "--version"],
        [str(place / "python"), "-W", "error", "-c", SMOKE],
        [str(place / "rift"), "reconstruct", "scan.npz", "--out", "out", "--quiet"],
    ]
    for command in steps:
        # In a folder of its own, so that nothing of the checkout is imported.
        work = folder if folder.is_dir() else None
        try:
            done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
        except OSError as error:
            return f"{command[0]}: {error}"
        if done.returncode:
            said = (done.stderr or done.stdout).strip().splitlines()
            return f"{' '.join(command[:3])}: {said[-1] if said else done.returncode}"
    if not (folder / "out" / "slices" / "slice_00000.tif").is_file():
        return "rift reconstruct wrote no slice"
    print_parts(f"environment of {python}", installed(folder), _WORTH_LISTING)
    shutil.rmtree(folder)
    return ""


def installed(folder: Path) -> Counter[str]:
    """Bytes of each package of an environment, without pip and setuptools."""
    parts: Counter[str] = Counter()
    (packages,) = folder.glob("lib/python*/site-packages")
    for path in packages.rglob("*"):
        top = path.relative_to(packages).parts[0].removesuffix(".libs")
        if path.is_file() and "__pycache__" not in path.parts and top not in ("pip", "setuptools"):
            parts[top] += path.stat().st_size
    return parts


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options, description=__doc__)))
