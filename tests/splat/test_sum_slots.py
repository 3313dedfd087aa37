"""A splat's records are summed in the order of its tiles, whatever the bands."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from rift_cl.splat.raster import sum_slots


def sums_of(device, slots, records):
    lists = SimpleNamespace(slots=device.array(slots))
    return sum_slots(device, lists, device.array(records))


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
        lists = SimpleNamespace(slots=device.array(starts.astype(np.int32)))
        sums = sum_slots(device, lists, device.array(records[here]), onto=sums)
    assert device.get(sums).tobytes() == whole.tobytes()
    expected = np.add.reduceat(np.append(records, np.zeros((1, 9)), 0), slots[:-1], dtype=float)
    np.testing.assert_allclose(whole, expected * (counts > 0)[:, None], rtol=1e-4, atol=1e-5)
