"""A splat's records are summed in the order of its tiles, whatever the bands."""

from __future__ import annotations

import numpy as np

from rift_cl.splat.raster import SlotRecords, sum_slots


def sums_of(device, slots, records, onto=None):
    live = device.array(np.isfinite(records[:, 0]).astype(np.uint8))
    sent = device.array(slots)
    return sum_slots(device, sent, SlotRecords(device.array(records), live), onto=onto)


def test_records_are_summed_in_bands_to_the_same_bits(device):
    random = np.random.default_rng(0)
    counts = random.integers(0, 40, 300)
    slots = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    records = random.standard_normal((slots[-1], 9)).astype(np.float32)
    whole = device.get(sums_of(device, slots, records))
    sums = None
    for band in np.array_split(np.arange(40), 3):
        place = np.arange(slots[-1]) - np.repeat(slots[:-1], counts)
        here = np.isin(place, band)
        owners = np.repeat(np.arange(300), counts)[here]
        starts = np.concatenate([[0], np.cumsum(np.bincount(owners, minlength=300))])
        sums = sums_of(device, starts.astype(np.int32), records[here], sums)
    assert device.get(sums).tobytes() == whole.tobytes()
    expected = np.add.reduceat(np.append(records, np.zeros((1, 9)), 0), slots[:-1], dtype=float)
    np.testing.assert_allclose(whole, expected * (counts > 0)[:, None], rtol=1e-4, atol=1e-5)


def test_slots_that_are_not_live_are_not_read(device):
    slots = np.array([0, 3, 3, 5], np.int32)
    records = np.arange(20, dtype=np.float32).reshape(5, 4)
    records[[0, 3, 4]] = np.nan
    found = device.get(sums_of(device, slots, records))
    np.testing.assert_array_equal(found, [[12, 14, 16, 18], [0] * 4, [0] * 4])
