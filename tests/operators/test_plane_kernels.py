"""The kernels that copy an image into planes and planes into an image, at every ragged edge."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.reference import merge, split

SHAPES = [(1, 1), (1, 40), (40, 1), (16, 16), (15, 17), (33, 31)]
SLICES, FIRST = 2, 1


@pytest.fixture
def tiles(device):
    tile = 16 if device.traits.is_cpu else 1
    return lambda width, rows: (-(-width // tile), -(-rows // tile), SLICES)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("transpose", [0, 1])
def test_split(device, tiles, shape, transpose):
    margin = 3
    image = np.random.default_rng(1).standard_normal((4, *shape)).astype(np.float32)
    rows, width = shape[::-1] if transpose else shape
    plane = device.zeros((SLICES, rows, width + 2 * margin))
    device.launch(
        "plane_split",
        tiles(width, rows),
        image=device.array(image),
        plane=plane,
        slice0=FIRST,
        rows=rows,
        width=width,
        margin=margin,
        TRANSPOSE=transpose,
    )
    expected = split(image[FIRST : FIRST + SLICES], margin=margin, transpose=bool(transpose))
    assert np.array_equal(device.get(plane), expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_merge(device, tiles, shape):
    ny, nx = shape
    random = np.random.default_rng(2)
    by_rows = random.standard_normal((SLICES, ny, nx + 5)).astype(np.float32)
    by_columns = random.standard_normal((SLICES, nx, ny + 2)).astype(np.float32)
    image = device.zeros((4, ny, nx))
    device.launch(
        "plane_merge",
        tiles(nx, ny),
        by_rows=device.array(by_rows),
        by_columns=device.array(by_columns),
        image=image,
        slice0=FIRST,
        ny=ny,
        nx=nx,
        row_pitch=nx + 5,
        column_pitch=ny + 2,
    )
    expected = np.zeros((4, ny, nx), np.float32)
    expected[FIRST : FIRST + SLICES] = merge(by_rows, by_columns, ny=ny, nx=nx)
    assert np.array_equal(device.get(image), expected)
