"""What the rasterizer takes of a GPU, as offline compilers see it."""

import json

import pytest


@pytest.fixture
def registers(tool):
    missing = tool("portability.offline").why_not()
    if missing:
        pytest.skip(missing)
    return tool("raster_registers")


def test_three_channels_take_no_more_than_is_held(registers):
    held = json.loads(registers.HELD.read_text(encoding="utf-8"))["now"]
    now = registers.rows(("3 channels",))
    assert len(now) == 2 and registers.excesses(now, held) == []
    assert all(row["scratch"] == 0 and row["local"] <= 32 << 10 for row in now.values())
    assert all(row["ptx"] is None or row["ptx"] <= 64 for row in now.values())


@pytest.mark.full
def test_no_case_takes_more_than_is_held(registers):
    assert registers.main(registers.Options()) == 0


def test_more_than_is_held_is_told(registers):
    held = json.loads(registers.HELD.read_text(encoding="utf-8"))["now"]
    more = {key: {**row, "vgprs": row["vgprs"] + 9} for key, row in held.items()}
    assert len(registers.excesses(more, held)) == len(held) == 14
    assert registers.excesses(held, held) == []
