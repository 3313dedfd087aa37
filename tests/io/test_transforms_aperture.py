"""The opening of a lens in a transforms.json: read, kept, written, or refused by name."""

from __future__ import annotations

from pathlib import Path

import capture_files as made
import numpy as np
import pytest

from rift_cl.errors import FileFormatError, InputError, NonFiniteError
from rift_cl.geometry import Aperture
from rift_cl.io import open_capture, write_json
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.captures.view import as_pinholes, camera_at


def apertures(path: Path) -> list[Aperture | None]:
    return [view.camera.aperture for view in open_capture(path).views]


def test_each_frame_has_its_own_opening_or_that_of_the_file(tmp_path: Path) -> None:
    path = made.transforms(tmp_path, focus_distance=4.6)
    assert apertures(path) == [None] * len(made.NAMES), "no radius, no opening"
    made.changed(path, 0, aperture_radius=0.05)
    made.changed(path, 1, aperture_radius=0.12, focus_distance=5.0, wavelength=1e-4)
    made.changed(path, 2, aperture_radius=0)
    assert apertures(path) == [Aperture(0.05, 4.6), Aperture(0.12, 5.0, 1e-4), None]


def test_without_a_focus_it_is_at_infinity(tmp_path: Path) -> None:
    path = made.transforms(tmp_path, aperture_radius=0.1)
    assert apertures(path) == [Aperture(0.1, np.inf)] * len(made.NAMES)


def test_smaller_pictures_have_the_same_opening_and_pinholes_none(tmp_path: Path) -> None:
    capture = open_capture(made.transforms(tmp_path, aperture_radius=0.1, focus_distance=2))
    view = capture.views[0]
    assert camera_at(view, 2).aperture == Aperture(0.1, 2.0)
    bare = as_pinholes(capture).views[0]
    assert bare.camera.aperture is None and bare.image == view.image
    np.testing.assert_array_equal(bare.camera.view, view.camera.view)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    path = made.transforms(tmp_path, aperture_radius=0.1, wavelength=2e-4)
    made.changed(path, 0, focus_distance=3.0)
    views = open_capture(path).views
    record = transforms_of([view.camera for view in views], [view.name for view in views])
    write_json(path, record)
    assert apertures(path) == [view.camera.aperture for view in views]


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"aperture_radius": -0.1}, InputError, r"'aperture_radius' is -0.1"),
        ({"aperture_radius": "wide"}, FileFormatError, "'aperture_radius' is 'wide'"),
        ({"aperture_radius": float("nan")}, NonFiniteError, "'aperture_radius' is nan"),
        ({"focus_distance": 0}, InputError, "'focus_distance' is 0"),
        ({"focus_distance": -4.6}, InputError, r"'focus_distance' is -4.6"),
        ({"focus_distance": [4.6]}, FileFormatError, "'focus_distance' is"),
        ({"focus_distance": float("inf")}, NonFiniteError, "'focus_distance' is inf"),
        ({"wavelength": -1e-4}, InputError, r"'wavelength' is -0.0001"),
    ],
)
def test_an_opening_that_is_none_is_named(
    tmp_path: Path, changes: dict[str, object], kind: type[Exception], message: str
) -> None:
    path = made.transforms(tmp_path, aperture_radius=0.1, focus_distance=4.6)
    made.changed(path, 1, **changes)
    with pytest.raises(kind, match=r"transforms\.json: frames\[1\].*" + message) as caught:
        open_capture(path)
    assert "\n" not in str(caught.value) and str(caught.value).count("transforms.json") == 1
