"""Formats of other makers: read back by readers of the tests, within what the formats round."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from splat_readers import C0, read_compressed_ply, read_glb, read_sog, read_spz

from rift_cl.errors import InputError
from rift_cl.io.scenes.formats import palettes
from rift_cl.io.scenes.formats.formats import FORMATS
from rift_cl.io.scenes.formats.plain import along_curve, unit_quats
from rift_cl.io.scenes.formats.spz import encode_spz, fraction_bits, place_notes, scene_notes
from rift_cl.io.scenes.splat_activations import opacities_of, scales_of
from rift_cl.io.scenes.splat_scene import SplatScene, XrayScene

# Of a rotation's smaller components, by 10 bits: half a step, as an angle of the whole rotation.
TURN = 4e-3


def scene(count: int = 700, degree: int = 3) -> SplatScene:
    random = np.random.default_rng(count)
    rest = random.normal(0, 0.2, (count, (degree + 1) ** 2, 3)).clip(-0.9, 0.9)
    return SplatScene(
        means=random.normal(0, 3, (count, 3)),
        log_scales=random.uniform(-6, 0, (count, 3)),
        quats=random.normal(size=(count, 4)),
        logit_opacities=random.normal(0, 3, count),
        sh=rest,
    )


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    cosines = np.abs(np.einsum("ni,ni->n", one, other)) / np.linalg.norm(other, axis=1)
    return 2 * np.arccos(np.clip(cosines, 0, 1))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("name", ["compressed-ply", "spz"])
def test_what_is_read_back_is_what_was_written_within_the_levels(name: str, degree: int) -> None:
    given = along_curve(scene(degree=degree))
    content = FORMATS[name].encode(given)
    read = (read_compressed_ply if name == "compressed-ply" else read_spz)(content)
    apart = {key: np.abs(read[key]).max(initial=0) * 1e-6 + 1e-6 for key in read}
    if name == "spz":
        places, scales, colors, rest = 0.5 ** fraction_bits(given.means) / 2, 1 / 32, 0.0037, 1 / 16
    else:
        cut = [slice(k, k + 256) for k in range(0, len(given), 256)]
        boxes = [np.ptp(given.means[part], axis=0) for part in cut]
        sizes = np.repeat(boxes, [256, 256, 700 - 512], axis=0)
        places, scales = sizes / 2046, 6 / 2046
        colors, rest = np.ptp(C0 * given.sh[:, 0]) / 510, 1 / 64
    assert np.all(np.abs(read["means"] - given.means) <= places + apart["means"])
    assert np.abs(read["log_scales"] - given.log_scales).max() <= scales + apart["log_scales"]
    opacities = opacities_of(given.logit_opacities)
    assert np.abs(read["opacities"] - opacities).max() <= 1 / 510 + 1e-6
    assert np.abs(read["colors"] - 0.5 - C0 * given.sh[:, 0]).max() <= colors + 1e-6
    assert read["rest"].shape == given.sh[:, 1:].shape
    assert np.abs(read["rest"] - given.sh[:, 1:]).max(initial=0) <= rest + 1e-6
    assert angles(unit_quats(given), read["quats"]).max() <= TURN


def test_gltf_keeps_every_bit_and_says_what_it_is() -> None:
    given = scene(degree=2)
    document, read = read_glb(FORMATS["glb"].encode(given))
    mark = "KHR_gaussian_splatting"
    assert document["extensionsUsed"] == [mark]
    primitive = document["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 0
    assert primitive["extensions"][mark]["colorSpace"] == "srgb_rec709_display"
    np.testing.assert_array_equal(read["POSITION"], given.means)
    np.testing.assert_array_equal(read[f"{mark}:SCALE"], scales_of(given.log_scales))
    np.testing.assert_array_equal(read[f"{mark}:OPACITY"], opacities_of(given.logit_opacities))
    quats = np.roll(read[f"{mark}:ROTATION"], 1, axis=1)
    np.testing.assert_allclose(quats, unit_quats(given), atol=1e-7)
    orders = [(degree, m) for degree in range(3) for m in range(2 * degree + 1)]
    for number, (degree, m) in enumerate(orders):
        values = read[f"{mark}:SH_DEGREE_{degree}_COEF_{m}"]
        np.testing.assert_array_equal(values, given.sh[:, number])
    bounds = document["accessors"][primitive["attributes"]["POSITION"]]
    assert bounds["min"] == given.means.min(0).tolist()
    colors = np.clip(0.5 + C0 * given.sh[:, 0], 0, 1)
    assert np.abs(read["COLOR_0"][:, :3] / 255 - colors).max() <= 1 / 510 + 1e-6


def test_pictures_of_sog_hold_places_rotations_and_opacities_to_their_bits() -> None:
    given = along_curve(scene(degree=3))
    read = read_sog(FORMATS["sog"].encode(given))
    curved = np.sign(given.means) * np.log1p(np.abs(given.means.astype(float)))
    steps = np.ptp(curved, axis=0) / 65535
    again = np.sign(read["means"]) * np.log1p(np.abs(read["means"]))
    assert np.all(np.abs(again - curved) <= steps / 2 + 1e-9)
    assert np.abs(read["opacities"] - opacities_of(given.logit_opacities)).max() <= 1 / 510 + 1e-6
    assert angles(unit_quats(given), read["quats"]).max() <= 4 * TURN


def test_palettes_of_sog_are_as_fine_as_even_ones_at_least() -> None:
    """Of 256 even levels the mean square error would be the square of their distance, by 12."""
    given = along_curve(scene(degree=3))
    read = read_sog(FORMATS["sog"].encode(given))
    for found, wanted in (
        (read["log_scales"], given.log_scales),
        (read["colors"], 0.5 + C0 * given.sh[:, 0]),
        # Fewer splats than vectors: each has its own.
        (read["rest"], given.sh[:, 1:]),
    ):
        even = (np.ptp(wanted) / 255) ** 2 / 12
        assert np.square(found - wanted).mean() <= even


def test_vectors_of_sog_are_shared_by_splats_that_are_alike() -> None:
    random = np.random.default_rng(5)
    kinds = random.normal(0, 0.3, (300, 4, 3)).astype(np.float32)
    given = along_curve(dataclasses.replace(scene(3000), sh=kinds[random.integers(0, 300, 3000)]))
    read = read_sog(FORMATS["sog"].encode(given))
    apart = read["rest"] - given.sh[:, 1:]
    assert np.sqrt(np.square(apart).mean()) < 0.05 * 0.3


def test_each_vector_has_the_nearest_entry_of_its_group_however_few_share_it() -> None:
    """Groups of single vectors, far from all others, once took more entries than there are."""
    random, count = np.random.default_rng(0), 16
    far = random.normal(size=(4, 3))
    far *= 1000 / np.linalg.norm(far, axis=1, keepdims=True)
    vectors = np.concatenate([random.normal(size=(1000, 3)), far]).astype(np.float32)
    palette, labels = palettes.vector_palette(vectors, count)
    assert len(palette) <= count
    group = palettes._nearest(vectors, palettes._clustered(vectors, round(count**0.5)))
    assert np.bincount(group).min() == 1
    taken: set[int] = set()
    for number in range(group.max() + 1):
        own, here = np.unique(labels[group == number]), vectors[group == number]
        assert taken.isdisjoint(own)
        taken.update(own)
        apart = np.linalg.norm(here[:, None] - palette[own], axis=2)
        found = apart[range(len(here)), np.searchsorted(own, labels[group == number])]
        np.testing.assert_allclose(found, apart.min(axis=1), rtol=1e-3)


@pytest.mark.each
@pytest.mark.parametrize("name", list(FORMATS))
def test_the_same_splats_are_the_same_bytes(name: str) -> None:
    assert FORMATS[name].encode(scene(300)) == FORMATS[name].encode(scene(300))


@pytest.mark.parametrize("name", list(FORMATS))
@pytest.mark.parametrize("count", [1, 2, 256, 257])
def test_few_splats_and_splats_in_one_place_are_written(name: str, count: int) -> None:
    given = scene(count, degree=1)
    flat = SplatScene(
        means=np.ones((count, 3)),
        log_scales=np.full((count, 3), -2.0),
        quats=given.quats,
        logit_opacities=np.full(count, 80.0),
        sh=np.full((count, 4, 3), 3.0),
    )
    assert FORMATS[name].encode(given) and FORMATS[name].encode(flat)


@pytest.mark.each
@pytest.mark.parametrize("name", list(FORMATS))
def test_what_a_format_cannot_hold_is_refused_in_a_sentence(name: str) -> None:
    plain = scene(4, 0)
    arrays = {key: getattr(plain, key) for key in ("means", "log_scales", "quats")}
    strengths = {"logit_opacities": plain.logit_opacities, "sh": plain.sh}
    modes = SplatScene(**arrays, **strengths, shape_modes=np.zeros((4, 3)))
    for wrong, words in (
        (modes, "shape order 1"),
        (XrayScene(**arrays, **strengths), "densities"),
        (SplatScene(**arrays, **strengths, activation="exp"), "activation exp"),
        (scene(4, 4), "degree 3"),
    ):
        with pytest.raises(InputError, match=words):
            FORMATS[name].encode(wrong)


def test_spz_takes_the_finest_numbers_that_hold_the_scene() -> None:
    given = scene(5, 0)
    for farthest, digits in ((4.0, 20), (100.0, 16), (8388607.0, 0)):
        far = np.zeros((5, 3))
        far[0, 0] = -farthest
        moved = SplatScene(far, given.log_scales, given.quats, given.logit_opacities, given.sh)
        assert fraction_bits(moved.means) == digits
        assert np.abs(read_spz(encode_spz(moved))["means"][:, 0]).max() == farthest
    with pytest.raises(InputError, match="scale the scene"):
        encode_spz(
            SplatScene(
                2 * far,
                *(getattr(given, n) for n in ("log_scales", "quats", "logit_opacities", "sh")),
            )
        )


def test_few_far_splats_do_not_make_the_places_of_spz_coarse() -> None:
    """They stay in their directions from the middle, as wide to the eye, in their order."""
    near = scene(597)
    near = dataclasses.replace(near, log_scales=near.log_scales - 3)
    means = np.concatenate([near.means, [[0, 9e5, 0], [0, 1e6, 0], [1e5, 0, -1e5]]])
    more = {n: getattr(near, n) for n in ("log_scales", "quats", "logit_opacities", "sh")}
    more = {name: np.concatenate([rows, rows[:3]]) for name, rows in more.items()}
    more["log_scales"][-3:] = np.log(1e4)
    given = SplatScene(means, **more)
    order = np.linalg.norm(along_curve(given).means, axis=1).argsort()
    read = read_spz(encode_spz(given))
    found, wanted = (places[order] for places in (read["means"], along_curve(given).means))
    assert np.abs(found[:-3] - wanted[:-3]).max() < 2.5e-4
    middle = np.median(means, axis=0)
    far, true = found[-3:] - middle, wanted[-3:] - middle
    lengths, distances = np.linalg.norm(far, axis=1), np.linalg.norm(true, axis=1)
    np.testing.assert_allclose(far / lengths[:, None], true / distances[:, None], atol=1e-6)
    assert lengths[1] < lengths[2]
    widths = np.exp(read["log_scales"][order][-3:]) / lengths[:, None]
    np.testing.assert_allclose(widths, 1e4 / np.repeat(distances[:, None], 3, 1), rtol=0.04)
    assert len(place_notes(near.means)) == 0
    (note,) = place_notes(given.means)
    assert note.startswith("3 of 600 splats") and "rounded by up to 0.00024 units" in note


def test_a_scene_far_from_its_origin_is_rounded_and_told_of() -> None:
    away = scene(600).means + np.float32([1e5, 0, 0])
    assert fraction_bits(away) == 6
    (note,) = place_notes(away)
    assert "rounded by up to 0.0078 units" in note and "from the origin" in note


def with_scales(log_scales: list[list[float]]) -> SplatScene:
    """Opaque splats a unit apart, whose standard deviations have these logarithms."""
    count = len(log_scales)
    return SplatScene(
        means=np.column_stack([np.arange(count), np.zeros((count, 2))]),
        log_scales=log_scales,
        quats=np.tile([1.0, 0, 0, 0], (count, 1)),
        logit_opacities=np.full(count, 5.0),
        sh=np.zeros((count, 4, 3)),
    )


def scaled_by(given: SplatScene, factor: float) -> SplatScene:
    log_scales = given.log_scales + np.float32(np.log(factor))
    return dataclasses.replace(given, means=given.means * factor, log_scales=log_scales)


def test_spz_refuses_a_scene_that_its_scales_would_make_another() -> None:
    """And the factor that it names does fit."""
    given = with_scales([[-4.0, 0, 0]] * 5 + [[-3.0, -3, -2]] * 20)
    assert not scene_notes(given)
    for factor, words, better in ((1000, "narrower", 0.1), (1e-4, "thicker", 1e3)):
        lost = scaled_by(given, factor)
        for made in (encode_spz, scene_notes):
            with pytest.raises(InputError, match=f"{words}.*lengths {better:g} times"):
                made(lost)
        assert not scene_notes(scaled_by(given, factor * better))


def test_spz_tells_of_few_scales_that_it_clips_and_not_of_those_that_nobody_sees() -> None:
    wide = scaled_by(with_scales([[-4.0, -3, 0]] + [[-4.0, -2, -2]] * 24), 500)
    (note,) = scene_notes(wide)
    assert note.startswith("1 of 25 splats") and "by up to 1.32 times" in note
    # A flat splat without thickness looks the same with one of a hundredth of a pixel.
    flat = with_scales([[-80.0, -3, -3]] * 25)
    assert not scene_notes(flat) and encode_spz(flat)
    (note,) = scene_notes(scaled_by(flat, 0.01))
    assert note.startswith("25 of 25 splats") and "thicker" in note


def test_spz_tells_of_colours_and_harmonics_that_it_clips() -> None:
    given = with_scales([[-3.0, -3, -3]] * 25)
    for number, (inside, outside) in enumerate([(3.34, 3.6), (1.01, 1.25)]):
        sh = given.sh.copy()
        sh[0, number, 1], sh[1:4, number, 2] = inside, -inside
        held = dataclasses.replace(given, sh=sh)
        assert not scene_notes(held)
        sh = sh.copy()
        sh[2:5, number, 0] = -outside
        (note,) = scene_notes(dataclasses.replace(given, sh=sh))
        assert note.startswith("3 of 25 splats") and f"up to {outside}" in note
        assert ("above the first" in note) == bool(number)
