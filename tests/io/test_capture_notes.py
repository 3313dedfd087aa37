"""What of a capture is not used, or may not be meant, is said in its notes and refused nowhere."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

import capture_files as made
import numpy as np
import OpenImageIO
import pytest
from PIL import Image, ImageCms
from view_files import store

from rift_cl.io import open_capture, write_png
from rift_cl.io.captures.capture_notes import range_notes
from rift_cl.io.images.read_picture import read_picture_header


def note(path: Path) -> str:
    """The one note of a capture."""
    (found,) = open_capture(path).notes
    return found


def two_models(folder: Path) -> Path:
    """Three photographs with poses in sparse/0, and a fourth in sparse/1 alone."""
    made.photographs(folder / "images", [*made.NAMES, "d.png"])
    made.colmap_text(folder / "sparse" / "0")
    other = made.colmap_text(folder / "sparse" / "1")
    lines = (other / "images.txt").read_text().splitlines()
    (other / "images.txt").write_text("\n".join(lines[:4]).replace("a.png", "d.png"))
    return folder


def test_an_ordinary_capture_has_no_notes(tmp_path: Path) -> None:
    assert open_capture(made.transforms(tmp_path / "a")).notes == ()
    made.photographs(tmp_path / "b" / "images")
    made.colmap_binary(tmp_path / "b" / "sparse" / "0")
    assert open_capture(tmp_path / "b").notes == ()


def test_photographs_without_a_pose_and_other_models_are_counted(tmp_path: Path) -> None:
    found = note(two_models(tmp_path))
    assert found.startswith(f"3 of 4 photographs in {tmp_path / 'images'} have a pose")
    assert "sparse/1 has 1" in found
    other = note(tmp_path / "sparse" / "1")
    # The folder of c.png has no photograph with a pose, and is not looked into.
    assert "1 of 3 photographs" in other and "sparse/0 has 3" in other
    assert open_capture(tmp_path, photographs=False).notes == ()


def test_a_model_beside_a_transforms_json_is_told_and_can_be_named(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    model = made.colmap_binary(tmp_path / "sparse" / "0")
    found = note(tmp_path)
    assert found.startswith("transforms.json is taken") and str(model) in found
    assert open_capture(tmp_path).points is None
    named = open_capture(model)
    assert named.points is not None and named.notes == ()
    # Whoever names the file has chosen.
    assert open_capture(path).notes == ()


def test_a_text_model_that_contradicts_the_binary_one_is_told(tmp_path: Path) -> None:
    made.photographs(tmp_path / "images")
    model = made.colmap_text(made.colmap_binary(tmp_path / "sparse"))
    assert open_capture(tmp_path).notes == ()
    lines = (model / "images.txt").read_text().splitlines()
    (model / "images.txt").write_text("\n".join([*lines[:2], *lines[4:]]))
    assert note(tmp_path).startswith(f"{model} holds two models that differ")
    made.colmap_text(model, ("PINHOLE", [21.0, *made.PINHOLE[1][1:]]))
    assert note(tmp_path).startswith(f"{model} holds two models that differ")
    (model / "images.txt").write_text("1 2 3")
    assert open_capture(tmp_path).notes == ()


def test_the_share_of_a_wide_fisheye_that_is_used_is_told(tmp_path: Path) -> None:
    """Of an equidistant fisheye of 180 degrees, counted by its own pixels."""
    lens = {"camera_model": "OPENCV_FISHEYE", "fl_x": 30, "fl_y": 30, "cx": 48, "cy": 48}
    path = made.transforms(tmp_path, **lens, w=96, h=96)
    for name in made.NAMES:
        write_png(tmp_path / "images" / name, np.zeros((96, 96, 3), np.uint8))
    x, y = np.meshgrid(*2 * [np.arange(96) - 47.5])
    radius = np.hypot(x, y)
    reach = np.tan(np.minimum(radius / 30, 1.57)) * 30 / radius
    share = np.mean((np.abs(x * reach) < 48) & (np.abs(y * reach) < 48))
    found = note(path)
    told = int(found.split(" % of the pixels")[0].split()[-1])
    assert found.startswith("3 of 3 photographs lose") and abs(told - 100 * share) <= 1
    path.write_text(json.dumps(json.loads(path.read_text()) | {"fisheye_crop_radius": 30}))
    assert not any("lose" in note for note in open_capture(path).notes)


def test_a_damaged_model_that_is_not_asked_for_does_not_matter(tmp_path: Path) -> None:
    (two_models(tmp_path) / "sparse" / "1" / "images.txt").write_text("1 2 3")
    assert note(tmp_path).endswith("have a pose")


def test_our_own_poses_were_told_of_when_they_were_found(tmp_path: Path) -> None:
    (two_models(tmp_path) / "sparse" / "0" / "poses.json").write_text('{"upright": true}')
    assert open_capture(tmp_path).notes == ()


@pytest.mark.parametrize("folder", ["masks", "mask"])
def test_masks_that_fit_no_photograph_or_some(tmp_path: Path, folder: str) -> None:
    path = made.transforms(tmp_path)
    made.photographs(tmp_path / folder, ["mask_0001.png"])
    assert str(tmp_path / folder) in note(path) and "sub/c.png" not in note(path)
    made.photographs(tmp_path / folder, ["a.png", "b.png.png"])
    assert "1 of 3 photographs, such as images/sub/c.png" in note(path)
    made.photographs(tmp_path / folder)
    assert open_capture(path).notes == ()


def test_where_masks_are_named_the_folder_says_nothing(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    made.photographs(tmp_path / "masks", ["x.png"])
    made.changed(path, 1, mask_path="masks/x.png")
    assert open_capture(path).notes == ()


@pytest.mark.parametrize(("cx", "doubted"), [(6.0, False), (4.0, False), (3.0, True), (9.0, True)])
def test_a_principal_point_far_from_the_middle_is_doubted(
    tmp_path: Path, cx: float, doubted: bool
) -> None:
    """That of pictures half as large lies at a quarter of the width, which is 12."""
    path = made.changed(made.transforms(tmp_path), 1, cx=cx)
    found = open_capture(path).notes
    assert bool(found) == doubted
    assert not doubted or f"1 of 3 photographs is far from the middle, such as ({cx:g}," in found[0]


@pytest.mark.parametrize("parts", [["test"], ["val", "test"]])
def test_the_files_beside_a_training_file_are_named(tmp_path: Path, parts: list[str]) -> None:
    """NeRF's synthetic scenes: the folder stands for what is trained on, its test file waits."""
    train = made.transforms(tmp_path).rename(tmp_path / "transforms_train.json")
    assert open_capture(tmp_path).notes == ()
    files = [tmp_path / f"transforms_{part}.json" for part in parts]
    for file in files:
        file.write_text(train.read_text())
    found = note(tmp_path)
    assert all(file.name in found for file in files)
    assert f"--test {' '.join(map(str, files))} --hold-out 0" in found
    # Whoever names a file has chosen, and transforms.json comes before its parts.
    assert open_capture(train).notes == open_capture(files[0]).notes == ()
    (tmp_path / "transforms.json").write_text(train.read_text())
    assert open_capture(tmp_path).notes == ()


def with_profile(path: Path, name: str, kind: str = "sRGB") -> Path:
    """A picture with a profile of this name; all of Pillow's are as long as 'sRGB built-in'."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile(kind)).tobytes()
    old = "sRGB built-in".encode("utf-16-be")
    new = name.ljust(13, "\0").encode("utf-16-be")
    assert profile.count(old) == 1 and len(new) == len(old)
    Image.new("RGB", (made.WIDTH, made.HEIGHT)).save(path, icc_profile=profile.replace(old, new))
    return path


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_colour_profiles_but_those_of_srgb_are_named(tmp_path: Path, suffix: str) -> None:
    for name in ("sRGB built-in", "My sRGB"):
        assert read_picture_header(with_profile(tmp_path / f"a.{suffix}", name)).profile == ""
    for name in ("Display P3", "linear sRGB"):
        assert read_picture_header(with_profile(tmp_path / f"a.{suffix}", name)).profile == name


def test_a_capture_tells_of_a_colour_profile_once(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    for name in made.NAMES:
        with_profile(tmp_path / "images" / name, "Display P3")
    found = note(path)
    assert found.startswith("a.png ") and "'Display P3'" in found and "sRGB" in found
    assert open_capture(path, photographs=False).notes == ()


@pytest.mark.parametrize(("suffix", "kind"), [("tif", "float"), ("tif", "uint16"), ("exr", "half")])
def test_floating_tiffs_are_told_to_be_linear_light(tmp_path: Path, suffix: str, kind: str) -> None:
    """Others of floating-point numbers are so by custom, and whole numbers never."""
    notes = open_capture(stored(tmp_path, suffix, kind, 0.5)).notes
    assert len(notes) == (kind == "float")
    assert not notes or (notes[0].startswith("a.tif ") and "linear light" in notes[0])


def test_numbers_beyond_black_and_white_are_counted_in_the_light_of_the_fit(tmp_path: Path) -> None:
    views = open_capture(stored(tmp_path, "exr", "float", 0.5, 4.0, -0.2)).views
    for light, least, most in (("linear", -0.2, 4), ("display", -2.58, 1.82)):
        (found,) = range_notes(views, downscale=1, light=light)
        assert found.startswith("25 % of the numbers")
        assert f"in {light} light, from {least:.3g} to {most:.3g}:" in found
        assert "a fit takes them as they are" in found and "clipped" in found
    for kind, suffix in (("float", "exr"), ("uint16", "tif")):
        inside = open_capture(stored(tmp_path, suffix, kind, 1.0)).views
        assert range_notes(inside, downscale=1, light="display") == []


def stored(folder: Path, suffix: str, kind: str, *levels: float) -> Path:
    """A capture of grey pictures of another format: the first level, and one row of each other."""
    path = made.transforms(folder)
    pixels = np.full((made.HEIGHT, made.WIDTH, 3), levels[0], np.float32)
    for row, level in enumerate(levels[1:]):
        pixels[row] = level
    for name in made.NAMES:
        store((folder / "images" / name).with_suffix(f".{suffix}"), pixels, kind)
    path.write_text(path.read_text().replace(".png", f".{suffix}").replace(".jpg", f".{suffix}"))
    return path


def with_chunk(path: Path, kind: bytes, content: bytes) -> Path:
    """A PNG with a chunk before its pixels, where there was none that tells of colours."""
    image = Image.new("RGB", (made.WIDTH, made.HEIGHT))
    image.save(path)
    start, pixels = path.read_bytes().split(b"IDAT")
    check = zlib.crc32(kind + content).to_bytes(4, "big")
    chunk = len(content).to_bytes(4, "big") + kind + content + check
    path.write_bytes(start[:-4] + chunk + start[-4:] + b"IDAT" + pixels)
    return path


@pytest.mark.parametrize(
    ("kind", "content", "linear", "profile"),
    [
        (b"gAMA", (45455).to_bytes(4, "big"), False, ""),
        (b"gAMA", (55556).to_bytes(4, "big"), False, "gamma 1.8"),
        (b"gAMA", (100000).to_bytes(4, "big"), True, ""),
        (b"sRGB", b"\0", False, ""),
    ],
)
def test_the_gamma_of_a_png(
    tmp_path: Path, kind: bytes, content: bytes, linear: bool, profile: str
) -> None:
    header = read_picture_header(with_chunk(tmp_path / "a.png", kind, content))
    assert (header.linear, header.profile, header.floating) == (linear, profile, False)


SRGB = (0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06)
ADOBE = (*SRGB[:4], 0.21, 0.71, *SRGB[6:])


@pytest.mark.parametrize(
    ("white_first", "profile"),
    [(SRGB, ""), (ADOBE, "primaries of Adobe RGB"), ((*SRGB[:7], 0.2), "(0.15, 0.2)")],
)
def test_the_primaries_of_a_png(
    tmp_path: Path, white_first: tuple[float, ...], profile: str
) -> None:
    content = struct.pack(">8I", *(round(1e5 * value) for value in white_first))
    found = read_picture_header(with_chunk(tmp_path / "a.png", b"cHRM", content)).profile
    assert profile in found and bool(profile) == bool(found)
    overridden = with_chunk(tmp_path / "a.png", b"cHRM", content).read_bytes()
    start, rest = overridden[:33], overridden[33:]
    srgb = b"sRGB\0"
    chunk = b"\0\0\0\1" + srgb + zlib.crc32(srgb).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(start + chunk + rest)
    assert read_picture_header(tmp_path / "a.png").profile == ""


def test_the_primaries_of_openexr_are_told(tmp_path: Path) -> None:
    path = stored(tmp_path, "exr", "half", 0.5)
    pixels = np.full((made.HEIGHT, made.WIDTH, 3), 0.5, np.float32)
    cg = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    for primaries, words in ((cg, "primaries of ACEScg"), ((*SRGB[2:], *SRGB[:2]), None)):
        spec = OpenImageIO.ImageSpec(made.WIDTH, made.HEIGHT, 3, "half")
        spec.attribute("chromaticities", "float[8]", primaries)
        output = OpenImageIO.ImageOutput.create("a.exr")
        assert output.open(str(tmp_path / "images" / "a.exr"), spec)
        assert output.write_image(pixels) and output.close()
        notes = open_capture(path).notes
        assert len(notes) == (words is not None)
        assert words is None or (words in notes[0] and "linear sRGB" in notes[0])


def test_a_jpeg_that_is_not_srgb_by_its_exif_is_told(tmp_path: Path) -> None:
    """As cameras mark Adobe RGB, which they add no profile to."""
    codes = Image.new("RGB", (made.WIDTH, made.HEIGHT))
    exif = Image.Exif()
    for value, told in ((1, ""), (65535, "Adobe RGB")):
        exif.get_ifd(0x8769)[0xA001] = value
        codes.save(tmp_path / "a.jpg", exif=exif)
        found = read_picture_header(tmp_path / "a.jpg").profile
        assert told in found and bool(told) == bool(found)


def test_codes_that_are_linear_light_are_told_of(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    pixels = np.zeros((made.HEIGHT, made.WIDTH, 3), np.float32)
    store(tmp_path / "images" / "a.png", pixels, "uint16", **{"oiio:ColorSpace": "linear"})
    assert note(path).startswith("a.png ") and "linear light" in note(path)
    value = json.loads(path.read_text().replace("a.png", "a.exr"))
    path.write_text(json.dumps(value))
    store(tmp_path / "images" / "a.exr", pixels, "float")
    assert open_capture(path).notes == ()
