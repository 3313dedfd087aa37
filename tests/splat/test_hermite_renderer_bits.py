"""Splats with Hermite modes: the same bits every time and in bands, within what was estimated."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib

import numpy as np
import pytest
from hermite_frames import SIZE, camera, drawn, few

import rift_cl as rift
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.splat.bands import FrameMemory, entries_per_row
from rift_cl.splat.tile_lists import Tiles

pytestmark = pytest.mark.dealt

RASTER_PASS = importlib.import_module("rift_cl.splat.raster_pass")


def digest(renderer, frame):
    """SHA-256 of the image and of every gradient."""
    device, random = renderer.device, np.random.default_rng(1)
    coming = [random.normal(size=array.shape) for array in (frame.image, frame.transmittance)]
    found = renderer.backward(frame, *map(device.array, coming), with_camera=True)
    arrays = [frame.image, frame.transmittance, *vars(found.splats).values(), found.sh]
    arrays += [found.camera]
    hosts = [device.get(array) for array in arrays if array is not None]
    assert len(hosts) == 13 and all(np.isfinite(host).all() and host.any() for host in hosts)
    return hashlib.sha256(b"".join(host.tobytes() for host in hosts)).hexdigest()


def many(device):
    values = few(300, seed=2)
    return drawn(device, values, tile=8, activation="exp")


def needs(device, frame, *, gradient):
    """Bytes for the image at once, and for its fullest row of tiles."""
    given = (frame.splats, frame.camera.size, frame.image.shape[2], frame.raster_pass.settings)
    memory = dataclasses.replace(FrameMemory.of(*given), gradient=gradient)
    tiles = Tiles.of(SIZE, 8)
    rows = entries_per_row(device.get(frame.projection.boxes), tiles)
    whole = memory.lists(frame.lists.n_entries, tiles.count)
    return memory.fixed + whole, memory.fixed + memory.lists(int(rows.max()), tiles.across)


@pytest.mark.full
def test_another_run_gives_the_same_bits(device):
    assert digest(*many(device)) == digest(*many(device))


def test_bands_within_a_small_budget_give_the_same_bits(device, monkeypatch):
    """Backward row by row of tiles, and forward in the least that a picture can be drawn in."""
    plans, plan = [], RASTER_PASS.plan_bands
    monkeypatch.setattr(RASTER_PASS, "plan_bands", lambda *a: plans.append(plan(*a)) or plans[-1])
    renderer, frame = many(device)
    whole, right = digest(renderer, frame), device.get(frame.image)
    assert not plans
    monkeypatch.setattr(rift.Device, "budget", needs(device, frame, gradient=True)[1])
    assert digest(*many(device)) == whole
    assert len(plans[-1]) > 1
    monkeypatch.setattr(rift.Device, "budget", needs(device, frame, gradient=False)[1])
    cut = many(device)[1]
    assert cut.lists is None and len(plans[-1]) > 1
    assert device.get(cut.image).tobytes() == right.tobytes()


@pytest.mark.full
@pytest.mark.parametrize("shape, color", [(2, 1), (0, 0), (4, 0)])
def test_the_estimate_covers_what_is_allocated(device, monkeypatch, shape, color):
    values = few(600, shape=shape, color=color)
    taken, allocate = [], device.empty
    monkeypatch.setattr(device, "empty", lambda *a: taken.append(allocate(*a)) or taken[-1])
    renderer = Renderer(SplatSettings(activation="exp"), device=device)
    splats = Splats.upload(device, **values)
    frame = renderer.forward(splats, camera())
    for way_back in (False, True):
        if way_back:
            coming = device.array(np.ones((*SIZE, 3), np.float32))
            renderer.backward(frame, coming, with_camera=True)
        given = (splats, frame.camera.size, 3, renderer.settings)
        memory = dataclasses.replace(FrameMemory.of(*given), gradient=way_back)
        total = sum(array.nbytes for array in taken)
        estimate = memory.fixed + memory.lists(frame.lists.n_entries, frame.lists.tiles.count)
        assert total <= estimate <= 3 * total
