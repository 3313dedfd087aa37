"""The renderer gives the same bits in every run, process and number of threads, and in bands.

Bands are how an image is drawn within a memory budget, so the budget's arithmetic is tested here
as well: what is planned covers the image once, and what is estimated covers what is allocated.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import json
import weakref
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.errors import GivenUpError, ResourceLimitError
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.splat.bands import FrameMemory, check_fixed, entries_per_row, plan_bands
from rift_cl.splat.raster import raster_grad, sum_slots
from rift_cl.splat.tile_lists import Tiles

pytestmark = pytest.mark.dealt

RASTER_PASS = importlib.import_module("rift_cl.splat.raster_pass")
SIZE, TILE = (120, 160), 8


def drawn(device):
    """A frame with every output there is."""
    values = random_splats(3000)
    values["scales"] *= 10
    renderer = Renderer(SplatSettings(absgrad=True, tile=TILE), device=device)
    splats, background = Splats.upload(device, **values), device.array([0.2, 0.5, 0.9])
    camera = camera_of("pinhole", size=SIZE)
    return renderer, renderer.forward(splats, camera, background=background, depth="expected")


def gradient(renderer, frame, **more):
    random, device = np.random.default_rng(1), renderer.device
    coming = [random.normal(size=array.shape) for array in (frame.image, frame.transmittance)]
    return renderer.backward(frame, *map(device.array, coming), with_camera=True, **more)


def digest(renderer, frame, **more):
    """SHA-256 of the image and of every gradient."""
    pictures = [frame.image, frame.transmittance]
    found = gradient(renderer, frame, **more)
    arrays = [*pictures, *vars(found.splats).values()]
    arrays += [found.sh, found.camera, found.background]
    hosts = [renderer.device.get(array) for array in arrays if array is not None]
    assert len(hosts) == 13 and all(np.isfinite(host).all() and host.any() for host in hosts)
    return hashlib.sha256(b"".join(host.tobytes() for host in hosts)).hexdigest()


def kind(device):
    return f"{device.selector} {'cpu' if device.traits.is_cpu else 'gpu'}"


def all_digests():
    """The digest of every device, a CPU dressed as a GPU as well; and compute units."""
    found = {}
    for device in rift.devices():
        found[f"{device.selector} units"] = device.traits.compute_units
        for is_cpu in {device.traits.is_cpu, False}:
            traits = dataclasses.replace(device.traits, is_cpu=is_cpu, optimized=is_cpu)
            dressed = rift.Device(device._handle, device.selector, traits=traits)
            found[kind(dressed)] = digest(*drawn(dressed))
    return found


@cache
def digests_elsewhere(python, threads):
    """What a fresh process finds, with so many of PoCL's threads."""
    code = "import json, sys; sys.path.insert(0, {!r}); import {} as test; print(json.dumps({}))"
    code = code.format(str(Path(__file__).parent), Path(__file__).stem, "test.all_digests()")
    done = python(code, POCL_MAX_PTHREAD_COUNT=threads)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.full
def test_another_run_gives_the_same_bits(device):
    renderer, frame = drawn(device)
    assert digest(renderer, frame) == digest(renderer, frame) == digest(*drawn(device))


@pytest.mark.full
@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_another_process_gives_the_same_bits_whatever_its_threads(device, python, threads):
    found = digests_elsewhere(python, threads)
    assert found[kind(device)] == digest(*drawn(device))
    if device.traits.pocl:
        assert found[f"{device.selector} units"] == int(threads)


def memory_of(frame, *, gradient):
    channels = frame.image.shape[2]
    memory = FrameMemory.of(frame.splats, frame.camera.size, channels, frame.raster_pass.settings)
    return dataclasses.replace(memory, gradient=gradient)


def needs(device, frame, *, gradient):
    """Bytes for the image at once, and bytes for its fullest row of tiles."""
    memory, tiles = memory_of(frame, gradient=gradient), Tiles.of(SIZE, TILE)
    rows = entries_per_row(device.get(frame.projection.boxes), tiles)
    whole = memory.lists(frame.lists.n_entries, tiles.count)
    return memory.fixed + whole, memory.fixed + memory.lists(int(rows.max()), tiles.across)


def plans_of(monkeypatch):
    """Record the bands that drawings are cut into."""
    plans = []

    def planned(*arguments):
        plans.append(plan_bands(*arguments))
        return plans[-1]

    monkeypatch.setattr(RASTER_PASS, "plan_bands", planned)
    return plans


@pytest.mark.full
@pytest.mark.parametrize("share", [0.0, 0.6])
def test_bands_within_any_budget_give_the_same_bits(device, monkeypatch, share):
    renderer, frame = drawn(device)
    whole, plans = digest(renderer, frame), plans_of(monkeypatch)
    least, most = needs(device, frame, gradient=True)[1], needs(device, frame, gradient=False)[0]
    monkeypatch.setattr(rift.Device, "budget", int(least + share * (most - least)))
    renderer, frame = drawn(device)
    assert frame.lists is None
    assert digest(renderer, frame) == whole
    forward, backward = plans
    assert 1 < len(forward) < len(backward)


@pytest.mark.full
def test_lists_are_cut_again_where_records_do_not_fit(device, monkeypatch):
    renderer, frame = drawn(device)
    whole, plans = digest(renderer, frame), plans_of(monkeypatch)
    monkeypatch.setattr(rift.Device, "budget", needs(device, frame, gradient=False)[0])
    renderer, frame = drawn(device)
    assert frame.lists is not None
    assert digest(renderer, frame) == whole
    assert len(plans) == 1 and len(plans[0]) > 1


@pytest.mark.full
def test_one_band_at_a_time_has_lists_and_records(device, monkeypatch):
    least = needs(device, drawn(device)[1], gradient=True)[1]
    made, most = [], []

    def counted(make):
        def noted(*given, **more):
            most.append(sum(one() is not None for one in made))
            found = make(*given, **more)
            made.append(weakref.ref(found))
            return found

        return noted

    for name in ("tile_lists", "raster_grad"):
        monkeypatch.setattr(RASTER_PASS, name, counted(getattr(RASTER_PASS, name)))
    monkeypatch.setattr(rift.Device, "budget", least)
    gradient(*drawn(device))
    # Where records are made, the band's lists are there.
    assert len(most) > 4 and max(most) == 1


@pytest.mark.full
def test_records_of_what_is_seen_alone_give_the_same_bits(device, monkeypatch):
    """Again, too: the second gradient lists and packs anew."""
    renderer, frame = drawn(device)
    whole, slots = digest(renderer, frame), []

    def noted(device, splats, lists, *given, **more):
        slots.append((lists.n_slots, lists.n_entries))
        return raster_grad(device, splats, lists, *given, **more)

    monkeypatch.setattr(RASTER_PASS, "_LARGE_RECORDS", 0)
    monkeypatch.setattr(RASTER_PASS, "raster_grad", noted)
    frame = drawn(device)[1]
    assert [digest(renderer, frame) for _ in range(2)] == [whole, whole]
    assert (slots[0][0] < slots[0][1]) == device.traits.is_cpu
    assert (frame.lists is None) == device.traits.is_cpu


@pytest.mark.parametrize("bands", [False, True])
def test_a_frame_that_is_not_retained_has_the_same_gradient_and_nothing_after_it(
    device, monkeypatch, bands
):
    renderer, frame = drawn(device)
    whole, least = digest(renderer, frame), needs(device, frame, gradient=True)[1]
    if bands:
        monkeypatch.setattr(rift.Device, "budget", least)
    renderer, frame = drawn(device)
    assert (frame.lists is None) == bands
    assert digest(renderer, frame, retain=False) == whole
    for name in ("image", "lists", "projection"):
        with pytest.raises(GivenUpError, match=f"no {name} any more"):
            getattr(frame, name)
    with pytest.raises(GivenUpError, match="retain"):
        gradient(renderer, frame)
    assert not hasattr(frame, "pictures")


def test_what_is_not_retained_is_gone_before_the_sums_are_made(device, monkeypatch):
    renderer, frame = drawn(device)
    raster_pass, projection = frame.raster_pass, frame.projection
    arrays = {
        **{name: getattr(projection, name) for name in ("screen", "boxes", "depths")},
        **{name: getattr(raster_pass.raster, name) for name in ("image", "last")},
        **{name: getattr(raster_pass.lists, name) for name in ("entries", "slots")},
        "records": raster_pass.screen.records,
    }
    known, left = {name: weakref.ref(array) for name, array in arrays.items()}, []
    del arrays, raster_pass, projection

    def noted(*given, **more):
        left.append([name for name, one in known.items() if one() is not None])
        return sum_slots(*given, **more)

    monkeypatch.setattr(RASTER_PASS, "sum_slots", noted)
    gradient(renderer, frame, retain=False)
    assert "raster_pass given up" in repr(frame)
    assert left == [["slots"]]


@pytest.mark.full
def test_device_with_little_memory_gives_the_same_bits(device):
    renderer, frame = drawn(device)
    memory = needs(device, frame, gradient=False)[0] - 1
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=memory)
    cut = drawn(small)
    assert cut[1].lists is None
    assert digest(*cut) == digest(renderer, frame)


CORNERS = st.tuples(*[st.integers(-3, 12)] * 4)
HOLDS = st.lists(CORNERS, max_size=60).map(lambda boxes: np.array(boxes, np.int32).reshape(-1, 4))


@settings(deadline=None)
@given(boxes=HOLDS, across=st.integers(1, 9), rows=st.integers(1, 9))
def test_entries_per_row_are_counted_tile_by_tile(boxes, across, rows):
    tiles = [(row, column) for row in range(rows) for column in range(across)]
    expected = [0] * rows
    for x0, y0, x1, y1 in boxes:
        for row, column in tiles:
            expected[row] += bool(x0 <= column < x1 and y0 <= row < y1)
    assert entries_per_row(boxes, Tiles(across, rows)).tolist() == expected


@settings(deadline=None)
@given(
    boxes=HOLDS,
    sizes=st.tuples(st.integers(1, 9), st.integers(1, 12)),
    room=st.integers(16_000, 45_000),
    gradient=st.booleans(),
)
def test_bands_cover_each_row_once_and_are_as_few_as_fit(boxes, sizes, room, gradient):
    tiles = Tiles(*sizes)
    memory = FrameMemory(len(boxes), 14, tiles.count * 64, 3, gradient=gradient)
    per_row = entries_per_row(boxes, tiles)

    def fits(first, stop):
        count = (stop - first) * tiles.across
        return memory.lists(int(per_row[first:stop].sum()), count) <= room

    if not all(fits(row, row + 1) for row in range(tiles.rows)):
        with pytest.raises(ResourceLimitError, match="one row of tiles"):
            plan_bands(boxes, tiles, memory, memory.fixed + room, 1 << 40)
        return
    bands = plan_bands(boxes, tiles, memory, memory.fixed + room, 1 << 40)
    stops = [band.first_row + band.rows for band in bands]
    assert [band.first_row for band in bands] == [0, *stops[:-1]] and stops[-1] == tiles.rows
    for band, stop in zip(bands, stops, strict=True):
        assert band.across == tiles.across and fits(band.first_row, stop)
        assert stop == tiles.rows or not fits(band.first_row, stop + 1)


def test_what_fits_no_bands_is_refused_in_one_sentence():
    memory, boxes = FrameMemory(100, 14, 240 * 64, 3), np.array([[0, 0, 30, 1]] * 100, np.int32)
    words = (
        r"^one row of tiles \(3000 splat and tile pairs\) needs .*, the memory budget is .*: raise"
    )
    with pytest.raises(ResourceLimitError, match=words):
        plan_bands(boxes, Tiles(30, 1), memory, memory.fixed + 50_000, 1 << 40)
    words = (
        "^100 splats and an image of 15360 pixels with 3 channels need .* budget is 1 KiB: raise"
    )
    with pytest.raises(ResourceLimitError, match=words):
        check_fixed(memory, 1024, 1 << 40)
    words = (
        "^100 splats and an image of 15360 .*, with the gradient, need .* budget is 1 KiB: raise"
    )
    with_gradient = dataclasses.replace(memory, gradient=True)
    with pytest.raises(ResourceLimitError, match=words):
        plan_bands(boxes, Tiles(30, 1), with_gradient, 1024, 1 << 40)
    words = "^an image of 15360 pixels with 3 channels takes 180 KiB, .* takes is 100 KiB.*smaller"
    with pytest.raises(ResourceLimitError, match=words):
        check_fixed(memory, 1 << 40, 100 << 10)


@pytest.mark.parametrize(
    ("count", "sh", "colors", "depth", "changes"),
    [
        (600, 16, 0, None, {}),
        (600, 4, 5, "accumulated", {"absgrad": True, "tile": 8}),
        (600, 0, 40, None, {"antialiased": True}),
        (600, 0, 1, None, {"mode": "xray"}),
        (0, 16, 0, None, {}),
        (0, 0, 40, None, {}),
        (600, 1, 0, "expected", {}),
    ],
)
def test_the_estimate_covers_what_is_allocated(
    device, monkeypatch, count, sh, colors, depth, changes
):
    values = random_splats(count, coefficients=sh or 1) | {"colors": np.ones((count, colors))}
    values = {n: v for n, v in values.items() if {"sh": sh, "colors": colors}.get(n, True)}
    taken, allocate = [], device.empty
    monkeypatch.setattr(device, "empty", lambda *a: taken.append(allocate(*a)) or taken[-1])
    renderer, camera = Renderer(SplatSettings(**changes), device=device), camera_of("pinhole")
    splats, background = Splats.upload(device, **values), device.zeros(colors + 3 * bool(sh))
    frame = renderer.forward(splats, camera, background=background, depth=depth)
    for way_back in (False, True):
        if way_back:
            gradient(renderer, frame)
        memory, total = memory_of(frame, gradient=way_back), sum(array.nbytes for array in taken)
        estimate = memory.fixed + memory.lists(frame.lists.n_entries, frame.lists.tiles.count)
        assert total <= estimate <= 3 * total
