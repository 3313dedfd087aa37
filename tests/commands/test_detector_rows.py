"""Rows and pixels of a detector that hold nothing are put between their neighbours, and named."""

from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.inputs.scan_rows import read_attenuation
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.io import scan_of_arrays

VIEWS, ROWS, BINS, DARK = 30, 12, 24, 100
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
_SHAPE = np.maximum(1 - np.linspace(-1.2, 1.2, BINS) ** 2, 0)
LINES = (1 + 0.1 * np.arange(ROWS)[:, None] + 0.1 * np.cos(ANGLES)[:, None, None]) * _SHAPE


def frames():
    """Counts of a beam that is even, with its flats and darks."""
    beam = np.full((3, ROWS, BINS), 20000.0, np.float32)
    return {
        "projections": (DARK + 20000 * np.exp(-LINES)).astype(np.float32),
        "flats": beam + DARK,
        "darks": np.full((2, ROWS, BINS), DARK, np.float32),
    }


def scan(made, kind="counts"):
    parts = {name: values for name, values in made.items() if name != "projections"}
    return scan_of_arrays(Path("scan"), made["projections"], ANGLES, kind=kind, **parts)


def dead(rows):
    made = frames()
    for values in made.values():
        values[:, rows] = 0
    return scan(made)


@pytest.mark.parametrize("rows", [[5], [4, 5, 6], [1, 10]])
def test_dead_rows_are_put_between_the_nearest_that_answer(rows):
    broken = dead(rows)
    found = read_attenuation(broken, 0, ROWS)
    np.testing.assert_allclose(found.projections, LINES, atol=1e-4)
    assert found.dead_rows == tuple(rows) and found.dead == BINS * len(rows)
    for row in range(ROWS):
        alone = read_attenuation(broken, row, row + 1)
        np.testing.assert_array_equal(alone.projections, found.projections[:, row : row + 1])
        assert alone.dead_rows == ((row,) if row in rows else ())


@pytest.mark.parametrize(("rows", "first"), [([4, 5, 6, 7], 4), ([0], 0), ([10, 11], 10)])
def test_rows_outside_the_beam_are_refused(rows, first):
    broken = dead(rows)
    for start, stop in ((0, ROWS), (rows[-1], rows[-1] + 1)):
        named = first if start == 0 else rows[-1]
        with pytest.raises(InputError, match=rf"in row {named}\b.*--rows"):
            read_attenuation(broken, start, stop)


@pytest.mark.parametrize("kind", ["counts", "transmission", "attenuation"])
def test_a_mask_of_nan_is_filled_as_dead_pixels_are(kind):
    made = frames()
    if kind != "counts":
        made = {"projections": np.exp(-LINES) if kind == "transmission" else LINES.copy()}
    for values in made.values():
        values[:, 3, [0, 9]] = np.nan
        values[:, 7] = np.nan
    found = read_attenuation(scan(made, kind), 0, ROWS)
    whole = np.delete(np.arange(ROWS), 3)
    np.testing.assert_allclose(found.projections[:, whole], LINES[:, whole], atol=1e-4)
    between = (LINES[:, 3, 8] + LINES[:, 3, 10]) / 2
    np.testing.assert_allclose(found.projections[:, 3, 9], between, atol=1e-4)
    assert found.dead_rows == (7,) and found.dead_bins == (0, 9)
    assert (found.dead, found.starved) == (BINS + 2, 0)


def test_nan_in_some_views_alone_is_refused():
    made = frames()
    made["projections"][1:, 3, 9] = np.nan
    with pytest.raises(NonFiniteError, match="view 1, row 3, bin 9"):
        read_attenuation(scan(made), 0, ROWS)
    made = frames()
    made["projections"][:, 3:7] = np.nan
    with pytest.raises(NonFiniteError, match=r"row 3 .*--rows"):
        read_attenuation(scan(made), 0, ROWS)


def test_dead_rows_are_named_and_no_doubt_is_left_of_them(tmp_path):
    made = frames()
    for values in made.values():
        values[:, ROWS // 2] = 0
    np.savez(tmp_path / "scan.npz", angles=ANGLES, **made)
    told = rift.reconstruct_scan(
        tmp_path / "scan.npz", tmp_path / "out", center=(BINS - 1) / 2, rings="off"
    )
    named = [note for note in told.notes if f"Row {ROWS // 2} does not answer" in note]
    assert len(named) == 1
    assert not [note for note in told.notes if "Doubt" in note]
