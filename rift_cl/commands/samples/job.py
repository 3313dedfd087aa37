"""``rift samples``: what there is, and putting one of them into a folder."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from rift_cl import sample
from rift_cl.commands.samples.download import checked, download
from rift_cl.commands.samples.settings import SamplesSettings
from rift_cl.errors import InputError, OutputError
from rift_cl.io.output import atomic_path, make_folder, writing
from rift_cl.sample.open_data import OPEN_DATA, OpenData

# Captures that come with the package: what each is, and where.
CAPTURES = {
    "ornament": ("60 views of a glossy ornament from a ring of cameras", sample.ornament),
    "ornament-off-path": ("8 views of the same from elsewhere", sample.ornament_off_path),
    "wall": ("24 views of a wall from its front", sample.wall),
}


def sample_facts() -> Iterator[tuple[str, dict[str, str]]]:
    """Each sample's name with what is known of it."""
    for name, (about, _) in CAPTURES.items():
        facts = {"what": about, "where": "comes with the package", "licence": "Apache-2.0"}
        yield name, {**facts, "try": f"rift fit {name} --out fit"}
    for name, data in OPEN_DATA.items():
        yield (
            name,
            {
                "what": data.about,
                "where": data.url or f"by hand, from {data.page}",
                "licence": data.licence,
                "file": f"{data.file}, {data.size:,} bytes",
                "sha256": data.sha256,
                "try": data.example,
            },
        )


def put_sample(settings: SamplesSettings) -> Path:
    """Put the sample that is named into its folder.

    Returns:
        The folder of a capture, the file of a data set.

    Raises:
        InputError: there is none of that name, it is no data set and a file is given, or the file
            is not the one that is listed.
        OutputError: it is there already, cannot be reached, or cannot be written.
    """
    name, folder = settings.name, settings.out or Path(settings.name)
    if name in CAPTURES and settings.file is None:
        return _copied_capture(CAPTURES[name][1](), folder)
    if name in CAPTURES:
        raise InputError(f"{name} comes with the package: leave --file out")
    if name not in OPEN_DATA:
        names = ", ".join([*CAPTURES, *OPEN_DATA])
        raise InputError(f"there is no sample {name!r}; there are {names}")
    return _put_data(name, OPEN_DATA[name], folder, settings.file)


def _copied_capture(source: Path, folder: Path) -> Path:
    with writing(folder):
        if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
            raise OutputError(f"{folder}: is there already; name another folder by --out")
        # Beside it and of a name of its own, so that nothing that is there is touched.
        own = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f"{folder.name}."))
        try:
            part = own / folder.name
            shutil.copytree(source, part, ignore=shutil.ignore_patterns("off_path", "__pycache__"))
            part.rename(folder)
        finally:
            shutil.rmtree(own, ignore_errors=True)
    return folder


def _put_data(name: str, data: OpenData, folder: Path, given: Path | None) -> Path:
    target = folder / data.file
    if target.exists():
        raise OutputError(f"{target}: is there already; name another folder by --out")
    if given is not None:
        checked(given, data.size, data.sha256)
        make_folder(folder)
        with atomic_path(target) as part:
            shutil.copyfile(given, part)
        return target
    if data.url is None:
        raise InputError(
            f"{name} has no address of its own: fetch {data.file} from {data.page}, then run "
            f"'rift samples {name} --file {data.file}'"
        )
    make_folder(folder)
    try:
        download(data.url, target, data.size, data.sha256)
    except OutputError as failure:
        raise OutputError(
            f"{failure}; fetch it on another computer and run 'rift samples {name} --file "
            f"{data.file}'"
        ) from failure
    return target
