"""Opposite views of a full turn, joined to a half turn nearly twice as wide."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.metrics import disc, psnr
from rift_cl.reconstruct.direct.offset_axis import widened
from rift_cl.reconstruct.preprocess.half_acquisition import stitched

SIZE, BINS, VIEWS, CENTER = 160, 92, 480, 11.3
ANGLES = 0.3 + np.arange(VIEWS) * 2 * np.pi / VIEWS
GRID = rift.Grid((SIZE, SIZE))
TRUTH = rift.phantom.shepp_logan(GRID)
SEEN = disc(GRID, radius=73.0)


def measured(center: float, angles: np.ndarray = ANGLES, bins: int = BINS):
    """The head as a detector sees it whose bins blur as wide as they are."""
    fine = 5
    over = rift.Parallel(angles, (bins + 8) * fine, 1 / fine, (center + 4) * fine + (fine - 1) / 2)
    blurred = gaussian_filter1d(rift.phantom.shepp_logan_sinogram(GRID, over), 0.6 * fine, axis=1)
    sinogram = blurred.reshape(len(angles), bins + 8, fine).mean(axis=2)[:, 4:-4]
    scan = rift.Parallel(angles, bins, center=center)
    return np.ascontiguousarray(sinogram, np.float32), scan


def quality(sinogram: np.ndarray, scan: rift.Parallel) -> float:
    return psnr(rift.fbp(rift.Projector(GRID, scan, "strip"), sinogram), TRUTH, mask=SEEN)


@pytest.mark.parametrize("center", [10.0, 10.5, BINS - 11.5])
def test_whole_and_half_bins_are_joined_exactly(center: float) -> None:
    sinogram, scan = measured(center)
    wide, joined = stitched(sinogram, scan)
    assert joined.bins == 2 * BINS - 1 - 2 * min(center, BINS - 1 - center)
    assert joined.center == (joined.bins - 1) / 2
    np.testing.assert_allclose(joined.angles, ANGLES[: VIEWS // 2])
    whole, _ = measured(joined.center, joined.angles, joined.bins)
    np.testing.assert_allclose(wide, whole, atol=2e-4 * whole.max())


@pytest.mark.parametrize("center", [CENTER, 15.75, BINS - 1 - CENTER])
@pytest.mark.parametrize("views", [VIEWS, VIEWS + 1])
def test_the_slices_are_those_of_weights(center: float, views: int) -> None:
    angles = np.arange(views) * 2 * np.pi / views
    sinogram, scan = measured(center, angles)
    wide, joined = stitched(sinogram, scan)
    assert len(wide) == -(-views // 2)
    score, weighed = quality(wide, joined), quality(*widened(sinogram, scan))
    print(f"axis {center:g} of {BINS}, {views} views: joined {score:.2f} dB, weighed {weighed:.2f}")
    assert score > weighed - 0.1
    whole, scan = measured(80.0, joined.angles, 161)
    assert score > quality(whole, scan) - 0.15


def test_views_in_any_order_with_noise_repeats_and_jitter() -> None:
    rng = np.random.default_rng(1)
    angles = ANGLES + rng.normal(0, 2e-4, VIEWS)
    angles = np.append(angles, angles[:3] + 2 * np.pi)
    sinogram, _ = measured(CENTER, angles)
    order = rng.permutation(len(angles))
    shuffled = rift.Parallel(angles[order], BINS, center=CENTER)
    wide, joined = stitched(sinogram[order], shuffled)
    assert abs(len(wide) - VIEWS // 2) <= 1
    assert quality(wide, joined) > quality(*widened(*measured(CENTER))) - 0.15


def test_rows_are_joined_as_one_is() -> None:
    sinogram, scan = measured(CENTER)
    both = np.stack([sinogram, 2 * sinogram], axis=1)
    wide, joined = stitched(both, scan)
    one, _ = stitched(sinogram, scan)
    assert wide.shape == (VIEWS // 2, 2, joined.bins)
    np.testing.assert_array_equal(wide[:, 0], one)
    np.testing.assert_allclose(wide[:, 1], 2 * one, rtol=1e-5, atol=1e-5)


def test_a_beam_that_faded_is_brought_to_one_level() -> None:
    sinogram, scan = measured(CENTER)
    faded = sinogram + np.linspace(0, 0.1 * sinogram.max(), VIEWS, dtype=np.float32)[:, None]
    steps = []
    for level in (False, True):
        wide, _ = stitched(faded, scan, level=level)
        # Air, at both ends.
        steps.append(abs(np.median(wide[:, :3] - wide[:, -3:], axis=1)).max())
    assert steps[0] > 0.04 * sinogram.max()
    assert steps[1] < 1e-2 * steps[0]
    kept, _ = stitched(sinogram, scan, level=True)
    np.testing.assert_allclose(kept, stitched(sinogram, scan)[0], atol=5e-3 * kept.max())


def test_lost_views_are_bridged() -> None:
    kept = np.delete(np.arange(VIEWS), [100, 101, 340])
    sinogram, scan = measured(CENTER, ANGLES[kept])
    wide, joined = stitched(sinogram, scan)
    assert np.isfinite(wide).all()
    assert quality(wide, joined) > quality(*widened(*measured(CENTER))) - 0.15


def test_the_same_as_algotom_s() -> None:
    conversion = pytest.importorskip("algotom.prep.conversion")
    views = VIEWS + 1  # both ends of the turn, as algotom wants them
    angles = np.arange(views) * 2 * np.pi / VIEWS
    sinogram, scan = measured(BINS - 12.0, angles)
    theirs, center = conversion.convert_sinogram_360_to_180(sinogram, BINS - 12.0)
    wide, joined = stitched(sinogram, scan)
    scores = []
    for view in (theirs, theirs[:, ::-1]):
        whole = rift.Parallel(angles[: len(view)], view.shape[1], center=center)
        scores.append(quality(np.ascontiguousarray(view, np.float32), whole))
    assert quality(wide, joined) > max(scores) - 0.1


def test_what_cannot_be_joined() -> None:
    sinogram, scan = measured(CENTER)
    with pytest.raises(InputError, match="no full turn"):
        stitched(sinogram[:240], rift.Parallel(ANGLES[:240], BINS, center=CENTER))
    for center in (-1.0, 0.0, BINS - 1.0, BINS + 4.0):
        with pytest.raises(InputError, match="do not overlap"):
            stitched(sinogram, rift.Parallel(ANGLES, BINS, center=center))
    with pytest.raises(ShapeError, match="wanted"):
        stitched(sinogram[:, :-1], scan)
