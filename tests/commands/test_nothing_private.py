"""Nothing that a fit, a film and a score leave behind tells where a photographer was, or who.

What EXIF and XMP say of place, name, and camera is planted in photographs. Every file that is
meant to be passed on is searched for it, as text and as bytes, and so are the pictures' own
headers. ``config.json`` of a fit is private: it names the folder that the photographs are in.
"""

from __future__ import annotations

import io
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from rift_cl.commands.cli import main

STAND_IN = Path(__file__).parents[1] / "io" / "fake_pycolmap"
# Words that occur nowhere else: the photographer, the copyright, the camera and its number, XMP.
SECRETS = ("Wilhelmina Fairweather", "Zanzibar-Copyright", "Quillcam", "QX-31337", "SN0042424242")
XMP = (
    '<?xpacket begin=""?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
    'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
    'xmlns:dc="http://purl.org/dc/elements/1.1/" dc:creator="Xanthippe Nightingale"/></rdf:RDF>'
    "</x:xmpmeta>"
)
DATE, LATITUDE = "1999:12:31 23:59:58", (47, 33, 41)
HEADERS = (b"<x:xmpmeta", b"http://ns.adobe.com/xap", b"Photoshop 3.0")


def exif() -> Image.Exif:
    facts = Image.Exif()
    artist, copyright, maker, model, serial = SECRETS
    facts[315], facts[33432], facts[271], facts[272], facts[306] = (
        *(artist, copyright, maker, model),
        DATE,
    )
    facts.get_ifd(0x8769)[0xA431] = serial
    place = facts.get_ifd(0x8825)
    place[1], place[2] = "N", tuple(IFDRational(value) for value in LATITUDE)
    place[3], place[4] = "E", tuple(IFDRational(value) for value in (8, 12, 55))
    return facts


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    """Four photographs with all of it, in a folder of somebody's."""
    folder = tmp_path / "Aunt Philomena" / "holiday"
    folder.mkdir(parents=True)
    random = np.random.default_rng(0)
    for number in range(4):
        codes = random.integers(0, 256, (24, 32, 3)).astype(np.uint8)
        picture = Image.fromarray(codes)
        picture.save(folder / f"IMG_{number}.jpg", exif=exif(), xmp=XMP.encode())
    content = (folder / "IMG_0.jpg").read_bytes()
    assert all(secret.encode() in content for secret in (*SECRETS, DATE, "Xanthippe Nightingale"))
    return folder


def left_by(folder: Path) -> list[Path]:
    """What is meant to be passed on: all but the settings and what the search for poses kept."""
    private = ("config.json", "poses", "checkpoints")
    files = [path for path in folder.rglob("*") if path.is_file()]
    return [path for path in files if not set(path.relative_to(folder).parts) & set(private)]


def assert_tells_nothing(path: Path, words: tuple[str, ...]) -> None:
    content = path.read_bytes()
    for word in words:
        assert word.encode() not in content and word.encode("utf-16-le") not in content, path.name
    assert not any(header in content for header in HEADERS), path.name
    if path.suffix in (".png", ".jpg"):
        with Image.open(io.BytesIO(content)) as picture:
            facts = picture.getexif()
            assert not (facts or facts.get_ifd(0x8769) or facts.get_ifd(0x8825)), path.name


@pytest.mark.full
def test_fits_films_and_scores_tell_neither_place_nor_name(photographs, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(STAND_IN))
    monkeypatch.setenv("FAKE_PYCOLMAP_SEEN", str(tmp_path / "seen.json"))
    monkeypatch.setenv("FAKE_PYCOLMAP_SIZE", "32 24")
    shared = tmp_path / "shared"
    fit, film, score = shared / "fit", shared / "film", shared / "score"
    short = ("--steps", "2", "--splats", "60")
    assert main(["fit", str(photographs), "--out", str(fit), *short]) == 0
    assert main(["render", str(fit), "--out", str(film), "--frames", "3", "--depth"]) == 0
    assert main(["eval", str(fit), "--out", str(score)]) == 0
    if find_spec("viser"):
        assert main(["export", str(fit), "--to", "html", "--out", str(shared / "page.html")]) == 0
    files = left_by(shared)
    names = {path.name for path in files}
    assert {"scene.ply", "transforms.json", "cameras.json", "report.html", "metrics.json"} <= names
    assert {"contact.png", "key_frames.json", "0000.png"} <= names
    words = (*SECRETS, DATE, "Xanthippe Nightingale", "Philomena")
    for path in files:
        assert_tells_nothing(path, words)


def test_what_was_planted_would_be_found(photographs):
    """The search finds what was planted, where it is."""
    for word in (*SECRETS, DATE, "Xanthippe Nightingale"):
        with pytest.raises(AssertionError):
            assert_tells_nothing(photographs / "IMG_1.jpg", (word,))
    with pytest.raises(AssertionError):
        assert_tells_nothing(photographs / "IMG_1.jpg", ())
