"""What a file holds is told in one line, or refused with the option that settles it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import h5py
import mrcfile
import numpy as np
import pytest
import tiff_files as made
import tifffile
from scipy.io import savemat

from rift_cl.errors import DTypeError, FileFormatError, InputError, PathEscapeError, ShapeError
from rift_cl.io import open_scan
from rift_cl.io.scans.angle_list import AngleList
from rift_cl.io.scans.axes import axes_of, parsed
from rift_cl.io.scans.frame_words import is_said, says_angles, says_projections
from rift_cl.io.scans.kind import named_kind, possible_kinds, sampled

VIEWS, ROWS, BINS = 40, 3, 32
DEGREES = np.arange(VIEWS) * 4.5
BUMP = np.maximum(1 - (np.linspace(-1.2, 1.2, BINS)) ** 2, 0)


def lines(scale: float = 1.0, offset: float = 0.0) -> np.ndarray:
    """Line integrals of something round."""
    return np.broadcast_to(scale * BUMP + offset, (VIEWS, ROWS, BINS)).copy()


def hdf5(path: Path, **arrays: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name] = array
    return path


@pytest.mark.parametrize(
    ("values", "kinds"),
    [
        (lines(), ("attenuation",)),
        (lines(3.0), ("attenuation",)),
        (lines(3.0, -0.2), ("attenuation",)),
        (lines(300.0), ("attenuation",)),
        (0 * lines(), ("attenuation",)),
        (np.exp(-lines()), ("transmission",)),
        (np.exp(-lines(0.01)), ("transmission",)),
        (1.15 * np.exp(-lines(3)), ("transmission",)),
        (np.exp(-lines())[..., 12:20], ("transmission", "attenuation")),
        (lines(0.5, 0.4), ("transmission", "attenuation")),
        (3000.5 * np.exp(-lines()), ("counts",)),
        (6.5 * np.exp(-lines()), ("counts", "attenuation")),
        (np.rint(9 * np.exp(-lines())), ("counts",)),
        (lines(300.0, 1.5), ("counts", "attenuation")),
        (lines(2.0, 5.0), ("counts", "attenuation")),
        (-lines(3.0), ("attenuation", "transmission")),
    ],
)
def test_values_tell_their_kind_or_leave_a_doubt(
    values: np.ndarray, kinds: tuple[str, ...]
) -> None:
    assert possible_kinds(sampled(values.astype("f4"), np.dtype("f4"))) == kinds
    assert possible_kinds(sampled(values.astype("f4"), np.dtype("u2"))) == ("counts",)


@pytest.mark.parametrize("beam", [3.6e4, 2e4])
def test_numbers_below_zero_that_wrapped_are_told_from_hits(tmp_path: Path, beam: float) -> None:
    """Darks that were subtracted without a sign, behind something dense."""
    noise = 4 * np.sin(7.0 * np.arange(VIEWS * ROWS * BINS)).reshape(VIEWS, ROWS, BINS)
    counts = np.rint(beam * np.exp(-lines(12)) + noise)
    flats = np.full((3, ROWS, BINS), beam, "u2")

    def told(values: np.ndarray) -> str:
        path = hdf5(tmp_path / "scan.h5", data=values, white=flats, theta=DEGREES)
        return " ".join(open_scan(path, dataset="data", flats="white", theta="theta").notes)

    wrapped = counts.astype("i4").astype("u2")
    assert (wrapped > 65000).any()
    assert "underflow" in told(wrapped) and "zingers" not in told(wrapped)
    whole = np.maximum(counts, 0).astype("u2")
    assert "Doubt" not in told(whole)
    hit, stuck = whole.copy(), whole.copy()
    hit[:, :, ::7] = 65535
    stuck[:, 1, 15] = 65530 + np.arange(VIEWS) % 5
    assert "underflow" not in told(hit if beam > 3e4 else stuck)


def random_views(random: np.random.Generator, shift: float, radius: float) -> np.ndarray:
    """Line integrals of up to four discs in nine views, the first of them apart by ``shift``."""
    t = np.linspace(-1, 1, 200)
    total = np.zeros((9, 200))
    for part in range(random.integers(1, 5)):
        r = radius * (random.uniform(0.1, 1) if part else 1)
        off = shift + (random.uniform(-1, 1) * (radius - r) if part else 0)
        angles = np.arange(9)[:, None] * np.pi / 9
        across = t - off * (np.cos(angles) if part or shift == 0 else 1)
        total += random.uniform(0.3, 1) * np.sqrt(np.maximum(r * r - across**2, 0)) / r
    return total * 10 ** random.uniform(-2, 0.9)


@pytest.mark.full
def test_attenuation_and_transmission_are_never_taken_for_one_another() -> None:
    random = np.random.default_rng(0)
    for _ in range(500):
        views = random_views(random, random.choice([0, 0.5, 0.9]), 10 ** random.uniform(-0.7, 0.1))
        noise = random.normal(0, 10 ** random.uniform(-4, -1.3), views.shape)
        for truth, other, values in (
            ("attenuation", "transmission", views + random.choice([0, 0, 0.1, -0.1])),
            ("transmission", "attenuation", np.exp(-views) * random.uniform(0.85, 1.15)),
        ):
            found = possible_kinds(sampled((values + noise).astype("f4"), np.dtype("f4")))
            assert found != (other,), (truth, values)


def test_what_lies_inside_the_detector_is_told_without_asking() -> None:
    random = np.random.default_rng(1)
    for _ in range(300):
        views = random_views(random, 0.0, random.uniform(0.2, 0.95))
        views *= random.uniform(0.3, 4) / views.max()
        noise = random.normal(0, 0.02, views.shape)
        for truth, values in (
            ("attenuation", views + noise * views.max()),
            ("transmission", np.exp(-views) + noise),
        ):
            assert possible_kinds(sampled(values.astype("f4"), np.dtype("f4"))) == (truth,)


def test_names_and_units_state_a_kind() -> None:
    assert named_kind(("counts", "transmission")) == "counts"
    assert named_kind(("", "sampleTransmission_01")) == "transmission"
    assert named_kind(("data", "sinogram")) is None
    assert named_kind(("raw_attenuation",)) is None


def test_a_name_settles_a_doubt_and_is_not_believed_against_the_values(tmp_path: Path) -> None:
    inner = np.exp(-lines())[..., 12:20]
    path = hdf5(tmp_path / "a.h5", transmission=inner, theta=DEGREES)
    assert open_scan(path, dataset="transmission").kind == "transmission"
    path = hdf5(tmp_path / "b.h5", transmission=lines(3.0), theta=DEGREES)
    with pytest.raises(InputError, match=r"transmission.*attenuation"):
        open_scan(path, dataset="transmission")
    assert open_scan(path, dataset="transmission", kind="attenuation").kind == "attenuation"


def test_the_line_says_everything(tmp_path: Path) -> None:
    data = np.rint(3000 * np.exp(-lines())).astype("u2")
    path = hdf5(
        tmp_path / "a.h5",
        **{"exchange/data": data, "exchange/theta": DEGREES},
        **{"exchange/data_white": np.full((1, ROWS, BINS), 3000, "u2")},
        **{"measurement/instrument/detector/actual_pixel_size_x": 0.65},
    )
    with h5py.File(path, "a") as file:
        file["measurement/instrument/detector/actual_pixel_size_x"].attrs["units"] = "um"
    scan = open_scan(path)
    assert scan.notes == (
        "a.h5: counts (uint16, 1105 to 3000 in the frames looked at), 1 flat and no darks; axes "
        "(angle, row, bin) 40 x 3 x 32; angles in degrees over 175.5; pitch 0.65 um.",
    )


def test_what_is_said_comes_first_and_must_make_sense(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5", p=lines(), theta=DEGREES, f=np.ones((2, ROWS, BINS)))
    for options, message in [
        ({"kind": "photons"}, "kind is 'photons', wanted counts, transmission, attenuation"),
        ({"angle_unit": "gon"}, "angle_unit is 'gon', wanted degrees, radians"),
        ({"axes": "angle,row"}, r"axes is 'angle,row', wanted angle, row and bin"),
        ({"axes": "angle,bin"}, r"has shape .* axes .angle, bin. were named for it: name 3"),
        ({"axes": "row,angle,bin"}, "40 angles for 3 projections"),
        ({"kind": "attenuation", "flats": "f"}, "--flats is about counts"),
        ({"kind": "counts"}, "holds counts, and there are no flats"),
        ({"flats": "air"}, "wants air at both ends"),
    ]:
        with pytest.raises(InputError, match=message):
            open_scan(path, dataset="p", **options)
    assert open_scan(path, dataset="p", axes="theta:y:x").shape == (VIEWS, ROWS, BINS)


def test_flats_beside_that_do_not_fit_are_passed_over(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5", p=lines(), theta=DEGREES, white=np.ones(7), dark=np.ones(7))
    assert open_scan(path, dataset="p").kind == "attenuation"


@pytest.mark.parametrize("form", ["npz", "h5", "mat"])
def test_projections_are_found_by_their_name_alone(tmp_path: Path, form: str) -> None:
    data = np.rint(3000 * np.exp(-lines())).astype(">u2")
    flats, darks = np.full((2, ROWS, BINS), 3000, ">u2"), np.full((2, ROWS, BINS), 9, ">u2")
    arrays = {"raw_data": data, "white": flats, "black": darks, "theta_deg": DEGREES, "step": 4.5}
    path = tmp_path / f"a.{form}"
    if form == "h5":
        hdf5(path, **{f"run/{name}": values for name, values in arrays.items()})
    elif form == "npz":
        np.savez(path, **arrays)
    else:
        savemat(path, {name: np.asarray(values, ">f4") for name, values in arrays.items()})
    scan = open_scan(path)
    assert (scan.kind, scan.shape) == ("counts", (VIEWS, ROWS, BINS))
    assert np.allclose(scan.angles, np.deg2rad(DEGREES))
    assert any("raw_data' are the projections (--dataset)" in note for note in scan.notes)
    assert any("white', " in note and "black'" in note for note in scan.notes)


def test_two_that_may_be_the_projections_are_asked_about(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5", data=lines(), sino=lines(), theta=DEGREES)
    with pytest.raises(InputError, match="dataset"):
        open_scan(path)
    with h5py.File(path, "a") as file:
        del file["sino"]
        file["other/sino"] = lines()
    assert open_scan(path).shape == (VIEWS, ROWS, BINS)


@pytest.mark.parametrize(
    ("name", "angles", "projections"),
    [
        ("anglesRad", True, False),
        ("rotation_angle", True, False),
        ("angle_step", False, False),
        ("RawData", False, True),
        ("frames", False, True),
        ("data_white", False, False),
        ("ring_current", False, False),
    ],
)
def test_names_of_angles_and_projections(name: str, angles: bool, projections: bool) -> None:
    assert (says_angles(name), says_projections(name)) == (angles, projections)
    assert not is_said("darks", name)


def test_geometry_alone_asks_for_no_kind(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5", p=np.full((VIEWS, ROWS, BINS), 7, "u2"), theta=DEGREES)
    assert open_scan(path, dataset="p", values=False).shape == (VIEWS, ROWS, BINS)
    with pytest.raises(InputError, match="holds counts"):
        open_scan(path, dataset="p")


@pytest.mark.parametrize(
    ("text", "axes"),
    [
        ("angle,row,bin", "nrb"),
        ("bin, angle", "bn"),
        ("Y:Theta:X", "rnb"),
        ("view row column", "nrb"),
    ],
)
def test_axes_in_words(text: str, axes: str) -> None:
    assert parsed(text) == axes


@pytest.mark.parametrize("text", ["", "angle", "row,bin", "angle,angle,bin", "angle,row,bin,time"])
def test_words_that_are_no_axes(text: str) -> None:
    with pytest.raises(InputError, match="axes is"):
        parsed(text)


@pytest.mark.parametrize(
    ("shape", "count", "usual", "axes"),
    [
        ((9, 4, 5), 9, None, "nrb"),
        ((4, 9, 5), 9, None, "rnb"),
        ((9, 5), 9, None, "nb"),
        ((5, 9), 9, None, "bn"),
        ((9, 9, 5), 9, "nrb", "nrb"),
        ((9, 1, 5), None, None, "nrb"),
        ((1, 9, 5), None, None, "rnb"),
        ((4, 9, 5), 9, "nrb", "rnb"),
        ((5, 4, 9), 9, "nrb", "nrb"),
        ((4, 4, 5), 7, None, "nrb"),
    ],
)
def test_the_number_of_angles_tells_the_axes(
    shape: tuple[int, ...], count: int | None, usual: str | None, axes: str
) -> None:
    assert axes_of(Path("a"), "p", shape, count=count, asked=None, usual=usual) == axes


@pytest.mark.parametrize(
    ("shape", "count"),
    [((9, 9, 5), 9), ((9, 5, 9), 9), ((9, 9), 9), ((5, 4, 9), 9), ((4, 5), None)],
)
def test_axes_that_fit_in_two_ways(shape: tuple[int, ...], count: int | None) -> None:
    with pytest.raises(ShapeError, match=r"--axes"):
        axes_of(Path("a"), "p", shape, count=count, asked=None)


def unit(values: np.ndarray, **options: Any) -> str:
    angles = AngleList("t", np.asarray(values, float), **options)
    return angles.settled(Path("a"), len(values), None)[1].split()[2]


def test_units_of_angles() -> None:
    steps = np.arange(50) / 50
    assert unit(180 * steps) == unit(120 * steps) == unit(-360 * steps) == "degrees"
    assert unit(np.pi * steps) == unit(2 * np.pi * steps) == "radians"
    assert unit(np.linspace(0, np.pi, 50)) == "radians"
    assert unit(180 * steps, usual="radians") == "degrees"
    assert unit(2 * steps, usual="radians") == "radians"
    assert unit(np.linspace(0, 10 * np.pi, 500), usual="radians") == "radians"
    for values, options in [
        (2 * steps, {}),
        (np.pi * steps, {"unit": "degrees"}),
        (180 * steps, {"unit": "radians"}),
        (100 * steps, {"usual": "radians"}),
        (1800 * steps, {}),
    ]:
        with pytest.raises(InputError, match=r"--angle-unit"):
            unit(values, **options)


def test_views_that_tell_nothing() -> None:
    with pytest.raises(InputError, match="holds one view"):
        unit(np.zeros(1))
    with pytest.raises(InputError, match=r"angles of 't'.*3 degrees"):
        unit(np.full(5, 3.0))


def test_pages_of_sinograms_are_read_row_by_row(tmp_path: Path) -> None:
    stack = made.frames(6)
    np.savetxt(tmp_path / "angles.txt", np.arange(made.ROWS) * 9.0)
    made.write_pages(tmp_path / "a.tif", stack)
    scan = open_scan(tmp_path / "a.tif", kind="attenuation")
    assert scan.shape == (made.ROWS, 6, made.BINS)
    for start, stop in ((0, 6), (2, 3), (4, 6)):
        read = scan.read(start, stop).projections
        assert read.flags.c_contiguous
        np.testing.assert_array_equal(read, stack.transpose(1, 0, 2)[:, start:stop])
    turned = open_scan(tmp_path / "a.tif", kind="attenuation", axes="bin,angle,row")
    np.testing.assert_array_equal(turned.read(3, 7).projections, stack.transpose(1, 2, 0)[:, 3:7])


def test_a_single_page_is_a_sinogram_where_the_angles_say_so(tmp_path: Path) -> None:
    page = made.frames(1)[0]
    tifffile.imwrite(tmp_path / "a.tif", page)
    with pytest.raises(ShapeError, match=r"angle, bin.*bin, angle"):
        open_scan(tmp_path / "a.tif", kind="attenuation")
    for axes, count in (("(angle, bin)", made.ROWS), ("(bin, angle)", made.BINS)):
        np.savetxt(tmp_path / "angles.txt", np.arange(count) * 7.0)
        scan = open_scan(tmp_path / "a.tif", kind="attenuation")
        expected = page if count == made.ROWS else page.T
        np.testing.assert_array_equal(scan.read(0, 1).projections[:, 0], expected)
        assert f"axes {axes} 20 x 24" in scan.notes[0]
    np.savetxt(tmp_path / "angles.txt", [0.0])
    with pytest.raises(InputError, match="1 angles for 20 projections"):
        open_scan(tmp_path / "a.tif", kind="attenuation")


def test_files_named_as_sinograms_are_not_taken_for_projections(tmp_path: Path) -> None:
    made.write_series(tmp_path / "a", "sino_{:04}.tif", made.frames())
    with pytest.raises(InputError, match=r"sinogram.*--axes"):
        open_scan(tmp_path / "a", kind="attenuation")
    scan = open_scan(tmp_path / "a", kind="attenuation", axes="row,angle,bin", theta="180")
    np.testing.assert_array_equal(
        scan.read(1, 3).projections, made.frames().transpose(1, 0, 2)[:, 1:3]
    )


def mrc(path: Path, data: np.ndarray, tilts: np.ndarray | None = None, height: float = 5.2) -> Path:
    """A tilt series, its angles in SerialEM's extended header."""
    with mrcfile.new(path, overwrite=True) as file:
        file.set_data(data)
        file.voxel_size = (5.2, height, 5.2)
        if tilts is not None:
            records = b"".join(struct.pack("<3h", round(100 * tilt), 1, 2) for tilt in tilts)
            file.set_extended_header(np.frombuffer(records, "V1"))
            file.header.exttyp = b"SERI"
            extra = bytearray(bytes(file.header.extra2))
            extra[16:20] = struct.pack("<2h", 6, 1 | 8)
            file.header.extra2 = np.void(bytes(extra))
    return path


TILTS = np.linspace(-60, 60, 11)


@pytest.mark.parametrize("dtype", ["i1", "i2", "u2", "f4", "f2"])
def test_tilt_series(tmp_path: Path, dtype: str) -> None:
    data = made.frames(11, "i2").astype(dtype)
    scan = open_scan(mrc(tmp_path / "a.mrc", data, TILTS), kind="attenuation")
    assert (scan.shape, scan.pitch, scan.unit) == (data.shape, pytest.approx(5.2), "angstrom")
    np.testing.assert_allclose(np.rad2deg(scan.angles), TILTS, atol=1e-6)
    np.testing.assert_array_equal(scan.read(3, 9).projections, data[:, 3:9].astype("f4"))
    assert "extended header, about the y axis" in scan.notes[1]
    assert scan.aspect == pytest.approx(1)
    high = open_scan(mrc(tmp_path / "b.mrc", data, TILTS, height=7.8), kind="attenuation")
    assert high.pitch == pytest.approx(5.2) and high.aspect == pytest.approx(1.5)


def test_tilts_beside_the_file(tmp_path: Path) -> None:
    path = mrc(tmp_path / "a.st", made.frames(11))
    with pytest.raises(FileFormatError, match=r"a\.tlt.*a\.rawtlt"):
        open_scan(path, kind="attenuation")
    np.savetxt(tmp_path / "a.rawtlt", TILTS)
    scan = open_scan(path, kind="counts")
    assert "each" not in scan.notes[0] and "mean of every view" in scan.notes[0]
    np.testing.assert_allclose(scan.incident, made.frames(11)[:, 0:20].mean(axis=(1, 2)), rtol=0.1)
    np.savetxt(tmp_path / "a.tlt", TILTS + 0.5)
    scan = open_scan(path, kind="attenuation")
    np.testing.assert_allclose(np.rad2deg(scan.angles), TILTS + 0.5)
    assert "a.tlt" in scan.notes[1]
    with pytest.raises(InputError, match=r"--kind counts.*--kind"):
        open_scan(path)
    (tmp_path / "a.tlt").unlink()
    (tmp_path / "in").mkdir()
    inner = mrc(tmp_path / "in" / "a.st", made.frames(11))
    (tmp_path / "in" / "a.tlt").symlink_to(tmp_path / "a.rawtlt")
    with pytest.raises(PathEscapeError):
        open_scan(inner, kind="attenuation")


def test_tilts_of_serialem_metadata(tmp_path: Path) -> None:
    """Sections may be listed in the order in which they were taken, from the middle outwards."""
    path = mrc(tmp_path / "a.mrc", made.frames(11))
    with pytest.raises(FileFormatError, match=r"a\.rawtlt or a\.mrc\.mdoc"):
        open_scan(path, kind="attenuation")
    order = sorted(range(11), key=lambda place: abs(place - 5))
    parts = [f"[ZValue = {n}]\nTiltAngle = {TILTS[n]:.2f}\nDefocus = -4\n" for n in order]
    beside = tmp_path / "a.mrc.mdoc"
    beside.write_text("\n".join(["PixelSpacing = 5.2\n[T = SerialEM: tilt axis]\n", *parts]))
    scan = open_scan(path, kind="attenuation")
    np.testing.assert_allclose(np.rad2deg(scan.angles), TILTS, atol=1e-6)
    assert "a.mrc.mdoc" in scan.notes[1]
    beside.write_text("\n".join([*parts[:-1], "[ZValue = 10]\n"]))
    with pytest.raises(FileFormatError, match="tilt angles of 10 of them"):
        open_scan(path, kind="attenuation")
    beside.write_text("[ZValue = 0]\nTiltAngle = left\n")
    with pytest.raises(FileFormatError, match="section 0 is 'left'"):
        open_scan(path, kind="attenuation")


def test_transforms_beside_a_tilt_series_are_told(tmp_path: Path) -> None:
    path = mrc(tmp_path / "a.mrc", made.frames(11), TILTS)
    moved = np.tile([1.0, 0, 0, 1, 3, 0], (11, 1))

    def told() -> str:
        np.savetxt(tmp_path / "a.xf", moved, fmt="%12.7f")
        return " ".join(open_scan(path, kind="attenuation").notes)

    assert "a.xf" not in told()
    moved[::2, 4] += 2
    moved[1::2, 5] -= 1
    assert "a.xf holds shifts of 1.1 pixels" in told()
    moved[:, 1] = 0.01
    assert "a.xf holds transforms" in told()


@pytest.mark.parametrize(
    ("place", "value", "kind", "message"),
    [
        (0, 1 << 30, FileFormatError, "the header claims .* bytes, the file has"),
        (8, -5, FileFormatError, "claims the size"),
        (92, 1 << 30, FileFormatError, "the header claims"),
        (92, -1, FileFormatError, "claims the size"),
        (12, 4, DTypeError, "samples are of mode 4"),
        (12, 99, DTypeError, "samples are of mode 99"),
    ],
)
def test_headers_that_lie(
    tmp_path: Path, place: int, value: int, kind: type[Exception], message: str
) -> None:
    path = mrc(tmp_path / "a.mrc", made.frames(11), TILTS)
    content = bytearray(path.read_bytes())
    content[place : place + 4] = struct.pack("<i", value)
    path.write_bytes(content)
    with pytest.raises(kind, match=message) as caught:
        open_scan(path, kind="attenuation")
    assert str(path) in str(caught.value)


def test_a_tilt_series_cut_short(tmp_path: Path) -> None:
    path = mrc(tmp_path / "a.mrc", made.frames(11), TILTS)
    content = path.read_bytes()
    for cut in (0, 100, 211, 212, 500, 1024, len(content) - 1):
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError, match=r"a\.mrc"):
            open_scan(path, kind="attenuation")


def test_what_tilt_series_do_not_have(tmp_path: Path) -> None:
    path = mrc(tmp_path / "a.mrc", made.frames(11), TILTS)
    for options in ({"dataset": "x"}, {"darks": "x"}, {"image_key": "x"}, {"flats": "x"}):
        with pytest.raises(InputError, match=r"a\.mrc"):
            open_scan(path, kind="counts", **options)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        (np.rint(1500 * lines()).astype("u2"), "reach 1498"),
        (-lines(), "negative"),
        (lines(12.0), ""),
        (lines() - 0.1, ""),
    ],
)
def test_values_that_are_no_line_integrals_are_doubted(
    tmp_path: Path, values: np.ndarray, word: str
) -> None:
    np.savez(tmp_path / "scan.npz", projections=values, angles=np.deg2rad(DEGREES))
    told = [n for n in open_scan(tmp_path / "scan.npz", kind="attenuation").notes if "Doubt" in n]
    assert len(told) == bool(word) and word in " ".join(told)


def test_frames_of_the_same_size_that_are_not_used_are_named(tmp_path: Path) -> None:
    counts = np.rint(3000 * np.exp(-lines())).astype("u2")
    flats, shutter = np.full((2, ROWS, BINS), 3000), np.full((4, ROWS, BINS), 20)
    path = hdf5(
        tmp_path / "scan.h5",
        **{"a/projections": counts, "a/angles": DEGREES, "a/openbeam": flats},
        **{"a/shutter": shutter, "a/small": shutter[..., 1:], "a/current": DEGREES},
    )
    told = " ".join(open_scan(path).notes)
    assert "'/a/shutter'" in told.replace("'a/", "'/a/") and "small" not in told
    assert "--darks" in told
    named = open_scan(path, darks="a/shutter")
    assert "not used" not in " ".join(named.notes)


def bright_counts(pixels: str) -> np.ndarray:
    """Counts of a beam of 10000 on 64 bins, some pixels of which read 65535, or all too much."""
    data = np.repeat(np.rint(1e4 * np.exp(-lines())), 2, axis=2)
    if pixels == "stuck":
        data[:, :, 20] = 65535
    if pixels == "zingers":
        data.reshape(-1)[::90] = 65535
    return 3 * data if pixels == "all" else data


@pytest.mark.parametrize("pixels", ["none", "stuck", "zingers", "all"])
def test_single_bright_pixels_do_not_speak_against_flats(tmp_path: Path, pixels: str) -> None:
    path = hdf5(
        tmp_path / "a.h5",
        **{"exchange/data": bright_counts(pixels).astype("u2"), "exchange/theta": DEGREES},
        **{"exchange/data_white": np.full((2, ROWS, 2 * BINS), 10000, "u2")},
    )
    if pixels == "all":
        with pytest.raises(InputError, match=r"times as bright.*zingers"):
            open_scan(path)
        return
    scan = open_scan(path)
    assert scan.kind == "counts"
    assert any("--zingers" in note for note in scan.notes) == (pixels != "none")
