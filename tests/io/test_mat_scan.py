"""MAT files of every version: layouts that are known, arrays that are named, and real scans."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from mat_files import VERSIONS, challenge, write_mat
from scan_files import BINS, DEGREES, FRAMES, ROWS, counts

from rift_cl.errors import DTypeError, FileFormatError, InputError, NonFiniteError, ShapeError
from rift_cl.geometry.fan import FanBeam
from rift_cl.io import ScanFile, open_scan, read_image
from rift_cl.io.scans.mat5 import Mat5File

each_version = pytest.mark.parametrize("version", VERSIONS)


def whole(scan: ScanFile) -> np.ndarray:
    return scan.read(0, scan.shape[1]).projections


@each_version
@pytest.mark.parametrize("name", ["CtDataFull", "CtDataLimited"])
def test_the_helsinki_challenge(tmp_path: Path, version: str, name: str) -> None:
    scan = open_scan(write_mat(tmp_path / "a.mat", {name: challenge()}, version))
    assert (scan.shape, scan.kind, scan.unit) == ((FRAMES, 1, BINS), "attenuation", "mm")
    assert scan.fan == FanBeam(400, 500, 0.2, (BINS - 1) / 2) and scan.pitch == 0.2
    assert name in scan.source
    # So few bins open by less than any scanner's.
    assert [note.split()[0] for note in scan.notes] == ["a.mat:", "The"]
    np.testing.assert_allclose(scan.angles, np.deg2rad(DEGREES), rtol=1e-15)
    np.testing.assert_array_equal(whole(scan)[:, 0], counts(FRAMES, BINS))
    np.testing.assert_array_equal(whole(pickle.loads(pickle.dumps(scan))), whole(scan))


@each_version
def test_one_of_several_challenges(tmp_path: Path, version: str) -> None:
    values = {"CtDataFull": challenge(), "CtDataLimited": challenge(distanceSourceOrigin=300.0)}
    path = write_mat(tmp_path / "a.mat", values, version)
    with pytest.raises(FileFormatError, match=r"'CtDataFull', 'CtDataLimited'"):
        open_scan(path)
    scan = open_scan(path, dataset="CtDataLimited")
    assert scan.fan is not None and scan.fan.source_to_axis == 300


@each_version
def test_dendrites(tmp_path: Path, version: str) -> None:
    sinogram = counts(BINS, FRAMES, dtype="f4")
    values = {"sinoRD": sinogram, "anglesRad": np.arange(FRAMES)[:, None] * 0.1, "Detectors": 5.0}
    scan = open_scan(write_mat(tmp_path / "a.mat", values, version))
    assert (scan.shape, scan.kind, scan.fan) == ((FRAMES, 1, BINS), "attenuation", None)
    assert scan.background == 1 and len(scan.notes) == 1
    np.testing.assert_allclose(scan.angles, np.arange(FRAMES) * 0.1, rtol=1e-15)
    np.testing.assert_array_equal(whole(scan)[:, 0], sinogram.T)


@each_version
def test_named_stack(tmp_path: Path, version: str) -> None:
    stack = counts(FRAMES, ROWS, BINS)
    values = {"d": {"p": stack, "phi": DEGREES, "w": stack[:2] + 900, "k": stack[0] + 7}}
    write_mat(tmp_path / "a.mat", values, version)
    scan = open_scan(tmp_path / "a.mat", dataset="d.p", theta="d.phi", flats="d.w", darks="d.k")
    assert (scan.shape, scan.kind) == (stack.shape, "counts")
    np.testing.assert_allclose(scan.angles, np.deg2rad(DEGREES), rtol=1e-15)
    rows = scan.read(1, 3)
    assert rows.flats is not None and rows.darks is not None
    np.testing.assert_array_equal(rows.projections, stack[:, 1:3])
    np.testing.assert_array_equal(rows.flats, stack[:2, 1:3] + 900)
    np.testing.assert_array_equal(rows.darks, stack[:1, 1:3] + 7)
    assert all(f.flags.c_contiguous and f.dtype == np.float32 for f in vars(rows).values())


@each_version
def test_a_sinogram_lies_as_its_angles_say(tmp_path: Path, version: str) -> None:
    sinogram = counts(FRAMES, BINS)
    radians = np.deg2rad(DEGREES)
    values = {"a": sinogram, "b": sinogram.T, "rad": radians, "flat": sinogram[:1].T + 99}
    path = write_mat(tmp_path / "a.mat", values, version)
    along, across = (
        open_scan(path, dataset="a", theta="rad", kind="attenuation"),
        open_scan(path, dataset="b", theta="rad", flats="flat"),
    )
    np.testing.assert_array_equal(along.angles, radians)
    np.testing.assert_array_equal(whole(along), whole(across))
    np.testing.assert_array_equal(across.read(0, 1).flats[:, 0], sinogram[:1] + 99)
    assert "axes (angle, bin) 6 x 5" in along.notes[0]
    assert "axes (bin, angle) 5 x 6" in across.notes[0]


@each_version
@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"])
def test_every_type_of_number(tmp_path: Path, version: str, dtype: str) -> None:
    stack = counts(FRAMES, ROWS, BINS, dtype=dtype)
    path = write_mat(tmp_path / "a.mat", {"p": stack}, version)
    scan = open_scan(path, dataset="p", theta="0:180", kind="attenuation", axes="angle,row,bin")
    np.testing.assert_array_equal(whole(scan), stack)
    np.testing.assert_allclose(np.rad2deg(scan.angles), np.arange(6) * 30.0, atol=1e-12)


def test_angles_from_a_file(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "a.mat", {"p": counts(FRAMES, BINS)}, "5")
    np.savetxt(tmp_path / "t.txt", DEGREES)
    scan = open_scan(path, dataset="p", theta=str(tmp_path / "t.txt"), kind="attenuation")
    np.testing.assert_allclose(scan.angles, np.deg2rad(DEGREES), rtol=1e-15)


@each_version
def test_a_file_without_a_known_layout_lists_its_numbers(tmp_path: Path, version: str) -> None:
    values = {"t": DEGREES, "x": {"p": counts(FRAMES, ROWS, BINS)}, "s": "text", "l": True}
    path = write_mat(tmp_path / "a.mat", values, version)
    with pytest.raises(FileFormatError) as caught:
        open_scan(path)
    listed = "it holds 'x.p' (6, 4, 5), 't' (1, 6): name those that are meant with dataset="
    assert listed in str(caught.value)
    with pytest.raises(FileFormatError, match=r"'y'.*'x\.p'"):
        open_scan(path, dataset="y", theta="t")
    with pytest.raises(FileFormatError, match=r"angles of 'x.p'.*--theta"):
        open_scan(path, dataset="x.p")
    with pytest.raises(FileFormatError, match="real numbers"):
        open_scan(write_mat(tmp_path / "b.mat", {"s": "text"}, version))


@each_version
@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"p": counts(FRAMES, BINS) > 3}, DTypeError, "'p'"),
        ({"p": "text"}, DTypeError, "'p'"),
        ({"p": counts(2, 3, 4, 5)}, ShapeError, r"wanted \(angle, row, bin\)"),
        ({"t": DEGREES[:-2]}, ShapeError, "4 angles for 6 projections"),
        ({"t": np.append(DEGREES[:-1], np.nan)}, NonFiniteError, "angle 5"),
        ({"t": np.zeros((2, 3))}, ShapeError, "'t' has shape"),
        ({"f": counts(2, BINS + 1)}, ShapeError, "rows and bins must agree"),
        ({"f": "text"}, DTypeError, "'f' does not hold"),
    ],
)
def test_arrays_that_do_not_fit(
    tmp_path: Path, version: str, changes: dict, kind: type[Exception], message: str
) -> None:
    values = {"p": counts(FRAMES, BINS), "t": DEGREES, "f": counts(2, BINS), **changes}
    path = write_mat(tmp_path / "a.mat", values, version)
    with pytest.raises(kind, match=message) as caught:
        open_scan(path, dataset="p", theta="t", flats="f")
    assert str(path) in str(caught.value)


@each_version
@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"distanceSourceOrigin": 0.0}, FileFormatError, "lacks distanceSourceOrigin"),
        ({"distanceSourceOrigin": "far"}, FileFormatError, "lacks distanceSourceOrigin"),
        ({"distanceSourceDetector": 1.0}, InputError, "behind the axis"),
        ({"pixelSize": -1.0, "pixelSizePost": np.inf}, FileFormatError, "a pixel size"),
        ({"angles": DEGREES[1:]}, ShapeError, "5 angles for 6"),
    ],
)
def test_challenges_that_lack_something(
    tmp_path: Path, version: str, changes: dict, kind: type[Exception], message: str
) -> None:
    path = write_mat(tmp_path / "a.mat", {"CtDataFull": challenge(**changes)}, version)
    with pytest.raises(kind, match=message) as caught:
        open_scan(path)
    assert str(path) in str(caught.value)


@each_version
def test_a_file_that_changed_since(tmp_path: Path, version: str) -> None:
    path = write_mat(tmp_path / "a.mat", {"CtDataFull": challenge()}, version)
    scan = open_scan(path)
    write_mat(path, {"CtDataFull": {**challenge(), "sinogram": counts(FRAMES, 9)}}, version)
    with pytest.raises(FileFormatError, match="open the scan again"):
        scan.read(0, 1)


def test_other_orders_of_bytes_and_odd_contents(tmp_path: Path) -> None:
    """What SciPy reads from the files that it brings along for its own tests."""
    folder = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
    files = sorted(folder.glob("test*_[67].*.mat"))
    if not files:
        pytest.skip(f"SciPy came without {folder}")
    numbers = 0
    for path in files:
        if path.read_bytes()[124:128] not in (b"\0\1IM", b"\1\0MI"):
            continue
        expected = scipy.io.loadmat(path)
        file = Mat5File(path, None)
        for name, array in file.arrays.items():
            if array.real and "." not in name and array.shape and 0 not in array.shape:
                np.testing.assert_array_equal(file.load(name), expected[name])
                numbers += 1
    assert numbers > 10


def test_the_real_challenge(shared_data: Path) -> None:
    """Rays of FanBeam through the truth give what was measured, which fixes signs and order."""
    scan = open_scan(shared_data / "htc2022" / "ta_category7.mat")
    truth = read_image(shared_data / "htc2022" / "ta_category7_truth.png")[::-1] > 0.5
    assert scan.fan is not None and scan.shape == (61, 1, 560)
    pixel = scan.fan.pitch / scan.fan.magnification
    gamma = scan.fan.fan_angles(560)
    steps = (np.arange(1024) - 511.5) * pixel / 2
    for view in (0, 30, 60):
        angle = scan.angles[view] - gamma[:, None]
        t = scan.fan.source_to_axis * np.sin(gamma[:, None])
        x, y = (
            t * np.cos(angle) - steps * np.sin(angle),
            t * np.sin(angle) + steps * np.cos(angle),
        )
        i, j = (np.clip(np.rint(v / pixel + 255.5).astype(int), 0, 511) for v in (y, x))
        line = truth[i, j].sum(axis=1) * pixel / 2
        assert np.corrcoef(line, whole(scan)[view, 0])[0, 1] > 0.985


def test_the_real_dendrites(shared_data: Path) -> None:
    path = shared_data / "dendrites" / "RealDataDend.mat"
    scan = open_scan(path)
    assert (scan.shape, scan.background) == ((360, 1, 1260), 20)
    np.testing.assert_array_equal(whole(scan)[:, 0], scipy.io.loadmat(path)["sinoRD"].T)
    np.testing.assert_allclose(np.diff(scan.angles), 0.0087272, atol=1e-5)
