"""The path-traced ornament: poses to a fraction of a pixel, no noise behind it, one seed.

What needs the path tracer is skipped where Mitsuba is not installed.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from importlib.util import find_spec

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.io import read_image

needs_mitsuba = pytest.mark.skipif(
    find_spec("mitsuba") is None, reason="mitsuba is not installed (extra: render)"
)


@pytest.fixture
def cameras(tool):
    return tool("ornament.cameras")


def test_strands_hang_on_the_seed_and_begin_on_the_ball(tool, tmp_path):
    module = tool("ornament.strands")
    one, same, other = (module.strands(seed) for seed in (3, 3, 4))
    for kind, lines in one.items():
        assert all(np.array_equal(a, b) for a, b in zip(lines, same[kind], strict=True))
    assert not np.array_equal(one["pale"][0], other["pale"][0])
    fine = [line for kind in ("pale", "green", "grass") for line in one[kind]]
    assert len(fine) == 300
    assert all((line[:, 3] > 0).all() and line[:, 3].max() < 0.007 for line in fine)
    for line in (*one["pale"], *one["green"]):
        assert np.linalg.norm(line[0, :3]) == pytest.approx(0.99)
    module.write_strands(tmp_path / "gold.txt", one["gold"])
    blocks = (tmp_path / "gold.txt").read_text().strip().split("\n\n")
    assert [len(block.split("\n")) for block in blocks] == [len(line) for line in one["gold"]]


def test_without_mitsuba_the_extra_is_named(tool, monkeypatch):
    tracer = tool("ornament.tracer")
    monkeypatch.setattr(tracer, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install mitsuba"):
        tracer.choose_variant("auto")


def test_without_libllvm_the_slow_variant_is_taken_and_the_reason_told(tool, monkeypatch):
    tracer = tool("ornament.tracer")
    monkeypatch.setattr(tracer, "find_spec", lambda name: object())
    monkeypatch.setattr(tracer, "_trial", lambda variant: "LLVM ERROR: Cannot select")
    variant, reason = tracer.choose_variant("auto")
    assert variant == "scalar_rgb"
    assert "Cannot select" in reason and "DRJIT_LIBLLVM_PATH" in reason
    with pytest.raises(InputError, match="DRJIT_LIBLLVM_PATH"):
        tracer.choose_variant("llvm_ad_rgb")
    monkeypatch.setattr(tracer, "_trial", lambda variant: None)
    assert tracer.choose_variant("auto")[0] == "llvm_ad_rgb"


@needs_mitsuba
def test_a_variant_that_does_not_exist_is_told_with_what_there_is(tool):
    with pytest.raises(InputError, match="scalar_rgb"):
        tool("ornament.tracer").choose_variant("frog")


def ball_alone(tool, samples):
    scenes = functools.partial(tool("ornament.scene").scenes, parts=("ball",))
    return tool("ornament.tracer").Tracer("scalar_rgb", seed=0, samples=samples, scenes=scenes)


def coverage(camera, parts=16):
    """(height, width) share of each pixel that sees the ball, by rays of the package's camera."""
    height, width = camera.size
    fx, fy, cx, cy = camera.intrinsics
    y, x = (np.indices((height * parts, width * parts)) + 0.5) / parts
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1)
    middle = camera.view[:3, 3]
    along = rays @ middle
    seen = along**2 > (rays**2).sum(axis=-1) * (middle @ middle - 1)
    return seen.reshape(height, parts, width, parts).mean(axis=(1, 3))


def centroid(mask):
    y, x = np.indices(mask.shape) + 0.5
    return np.array([(mask * x).sum(), (mask * y).sum()]) / mask.sum()


@needs_mitsuba
def test_the_ball_is_where_the_camera_says_to_a_hundredth_of_a_pixel(tool, cameras):
    tracer = ball_alone(tool, samples=150)
    poses = [cameras.ring(7, 12, 5.5)[2], cameras.off_path(8)[7]]
    shots = cameras.shots_at(poses, (45, 60), 45)
    shots.append(dataclasses.replace(shots[1], center=(23.4, 27.8)))
    for shot in shots:
        alpha, expected = tracer.light(shot, 0)[..., 3], coverage(shot.camera)
        assert np.abs(alpha - expected).max() < 0.25
        assert alpha.sum() == pytest.approx(expected.sum(), rel=2e-3)
        np.testing.assert_allclose(centroid(alpha), centroid(expected), atol=0.02)


@needs_mitsuba
@pytest.mark.parametrize(("radius", "focus"), [(0.12, 2.5), (0.25, 4.6), (0.25, 2.5)])
def test_a_thin_lens_blurs_an_edge_as_its_formula_says(tool, cameras, radius, focus):
    """A point at depth z becomes a disc, 2 A f |1/z - 1/F| pixels wide; so does the ball's edge."""
    tracer = ball_alone(tool, samples=900)
    pose = cameras.around(0, 0, 5.5)
    pose[2, 3] = 0
    (shot,) = cameras.shots_at([pose], (6, 160), 45)
    alpha = tracer.light(cameras.with_aperture(shot, radius, focus), 0)[..., 3]
    outward = np.concatenate([[1], alpha[2:4, 80:].mean(axis=0), [0]])
    weights, places = -np.diff(outward), np.arange(81)
    spread = np.sqrt(weights @ (places - weights @ places) ** 2)
    touched = 5.5 - 1 / 5.5
    disc = 2 * radius * shot.focal * abs(1 / touched - 1 / focus)
    # The discs across an edge are spread by a quarter of their width, and pixels are squares.
    assert spread == pytest.approx(np.sqrt((disc / 4) ** 2 + 1 / 6), rel=0.03)


@needs_mitsuba
def test_a_tiny_capture_has_a_background_without_noise_and_can_be_repeated(tool, tmp_path):
    script = tool("render_ornament")
    settings = script.Settings(views=2, size=(40, 30), samples=6)
    tracer = tool("ornament.tracer").Tracer("scalar_rgb", seed=0, samples=6)
    shots = script.shots_of(settings)
    for name in ("one", "two"):
        record = script.record_of(settings, shots, tracer.name)
        list(script.render_capture(tmp_path / name, record, lambda k: tracer.picture(shots[k], k)))
    for number in ("0000", "0001"):
        image = read_image(tmp_path / "one" / "images" / f"{number}.png")
        assert (np.rint(255 * image[:5, :5]) == 128).all()
        assert (np.abs(image - 0.5).max(axis=2) > 0.05).mean() > 0.2
        twin = read_image(tmp_path / "two" / "images" / f"{number}.png")
        assert np.array_equal(image, twin)
    assert (
        "scalar_rgb" in json.loads((tmp_path / "one" / "transforms.json").read_text())["renderer"]
    )
