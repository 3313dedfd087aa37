"""A picture that the device does not hold is drawn band by band, with the bits of the whole."""

from __future__ import annotations

import weakref
from importlib import import_module

import pytest
from hermite_frames import few as splats_with_modes
from limited_devices import assert_same, limited
from projection_scenes import camera_of
from projection_scenes import random_splats as visible_splats

import rift_cl as rift
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.splat import Renderer, Splats, SplatSettings
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.raster import Raster

RENDERER = import_module("rift_cl.splat.renderer")

# Seven rows of tiles, of which the last is shorter.
SIZE = (52, 75)
SETTINGS = SplatSettings(tile=8)


def bands_of(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Rows of the bands that are drawn for a picture."""
    rows, draw = [], RENDERER.draw_bands

    def noted(*given, **how):
        for band in draw(*given, **how):
            rows.append(len(band.image))
            yield band

    monkeypatch.setattr(RENDERER, "draw_bands", noted)
    return rows


def drawn(device: rift.Device, values: dict, settings: SplatSettings = SETTINGS, **how):
    splats, camera = Splats.upload(device, **values), camera_of("pinhole", size=SIZE)
    if settings.mode != "xray":
        how["background"] = device.array([0.2, 0.5, 0.9])
    return list(Renderer(settings, device=device).picture(splats, camera, **how))


@pytest.mark.full
@pytest.mark.parametrize(
    ("settings", "how"),
    [
        (SETTINGS, {"depth": "expected"}),
        pytest.param(SplatSettings(tile=8, mode="xray"), {}, marks=pytest.mark.full),
    ],
)
def test_an_image_larger_than_the_largest_buffer_has_the_same_bits(
    device, settings, how, monkeypatch
):
    values, rows = visible_splats(150), bands_of(monkeypatch)
    whole = drawn(device, values, settings, **how)
    assert not rows and whole[0].any()
    found = drawn(limited(device, allocation=30_000), values, settings, **how)
    assert_same(found, whole)
    assert len(rows) > 2 and sum(rows) == SIZE[0]


@pytest.mark.full
def test_an_image_of_splats_with_modes_has_the_same_bits(device, monkeypatch):
    values, rows = splats_with_modes(), bands_of(monkeypatch)
    found = drawn(limited(device, allocation=24_000), values)
    assert len(rows) > 2
    assert_same(found, drawn(device, values))


@pytest.mark.full
def test_an_image_larger_than_the_budget_has_the_same_bits(device, monkeypatch):
    values, rows = visible_splats(150), bands_of(monkeypatch)
    splats, channels = Splats.upload(device, **values), 3
    memory = FrameMemory.of(splats, SIZE, channels, SETTINGS)
    found = drawn(limited(device, memory.fixed - 1), values)
    assert len(rows) > 1
    assert_same(found, drawn(device, values))


def test_an_image_that_fits_without_its_lists_has_the_same_bits(device, monkeypatch):
    values, rows = visible_splats(150), bands_of(monkeypatch)
    memory = FrameMemory.of(Splats.upload(device, **values), SIZE, 3, SETTINGS)
    found = drawn(limited(device, memory.fixed + 1), values)
    assert len(rows) > 1
    assert_same(found, drawn(device, values))


def test_one_band_at_a_time_is_on_the_device(device, monkeypatch):
    made, empty = [], Raster.empty

    def noted(*given, **how):
        assert all(image() is None for image in made)
        band = empty(*given, **how)
        made.append(weakref.ref(band.image))
        return band

    monkeypatch.setattr(Raster, "empty", noted)
    drawn(limited(device, allocation=30_000), visible_splats(150))
    assert len(made) > 2


def test_what_is_no_picture_is_refused_in_one_sentence(device):
    values = visible_splats(20, coefficients=1)
    with pytest.raises(ResourceLimitError, match=r"one row of tiles of the picture takes 7\.5 KiB"):
        drawn(limited(device, allocation=5_000), values)
    with pytest.raises(ResourceLimitError, match=r"^20 splats need .* or draw fewer splats$"):
        drawn(limited(device, 5_000), values)
    renderer = Renderer(SETTINGS, device=limited(device, allocation=30_000))
    splats = Splats.upload(renderer.device, **values)
    camera = camera_of("pinhole", size=SIZE)
    with pytest.raises(ResourceLimitError, match="an image of 3900 pixels with 3 channels"):
        renderer.forward(splats, camera)
    with pytest.raises(InputError, match="depth is 'far'"):
        renderer.picture(splats, camera, depth="far")
