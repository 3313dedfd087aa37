"""Filters: their kernels against closed forms, their application against np.convolve."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl import Fan, Grid, HighPass, Parallel, Projector, Ramp, Response, dot_test, fbp
from rift_cl.errors import InputError, ResourceLimitError, ShapeError
from rift_cl.operators import FILTERS, ViewFilter, as_filter, register_filter
from rift_cl.operators.filters.ramp_filters import WINDOWS, Finer
from rift_cl.reference import filter_rows, ramp_taps, response_taps, shepp_logan_taps

pytestmark = pytest.mark.dealt

NAMES = ("ram-lak", "shepp-logan", "cosine", "hamming", "hann", "high-pass")
AT_NYQUIST = {"ram-lak": 1, "shepp-logan": 2 / np.pi, "cosine": 0, "hamming": 0.08, "hann": 0}
BINS, PITCH = 200, 0.7
NYQUIST = 0.5 / PITCH


def relative(value, truth):
    return np.linalg.norm(value - truth) / np.linalg.norm(truth)


def white(*shape):
    return np.random.default_rng(5).standard_normal(shape).astype(np.float32)


def response(taps, pitch, frequencies):
    """What a convolution kernel does to each frequency."""
    n = np.arange(len(taps)) - len(taps) // 2
    return pitch * np.cos(2 * np.pi * pitch * np.outer(frequencies, n)) @ taps


@pytest.mark.parametrize("bins", [1, 7, 8, 16, 17, 63, 64, 65, 130])
@pytest.mark.parametrize("rows", [None, 1, 3, 5])
def test_filtering_equals_convolution(device, bins, rows):
    scan = Parallel(np.arange(6.0), bins, PITCH)
    taps = np.random.default_rng(4).standard_normal(2 * bins - 1)
    taps = taps + taps[::-1]

    class Anything(Ramp):
        def taps(self, bins, pitch):
            return taps

    gains = np.linspace(-1, 2, 6)
    F = ViewFilter(scan, Anything(), rows=rows, gains=gains, device=device)
    y = white(*F.domain)
    # float32 sums of up to 130 terms of random sign; 2e-7 measured.
    assert relative(F(y), filter_rows(y, taps, PITCH, gains)) <= 1e-6


@pytest.mark.parametrize("name", AT_NYQUIST)
@pytest.mark.parametrize("cutoff", [0.5, 0.37])
@pytest.mark.parametrize("bins", [64, 129])
def test_a_window_ends_at_its_cutoff_wherever_that_lies_between_frequencies(name, cutoff, bins):
    """Taps are the integral of the windowed ramp, here by 20,000 trapezes."""
    f = np.linspace(0, cutoff / 2, 20001)
    ramp = f * WINDOWS[name](2 * f / cutoff)
    n = np.arange(bins)
    exact = 2 * np.trapezoid(ramp * np.cos(2 * np.pi * np.outer(n, f)), f, axis=1)
    taps = Ramp(name, cutoff).taps(bins, 1.0)[bins - 1 :]
    # What is left is the ringing of a hard end, which the transform's length cuts off; with the
    # last frequency taken whole it is 6.6e-2.
    assert relative(taps, exact) <= 1.2e-2


@pytest.mark.parametrize("name", NAMES)
def test_filters_by_name_equal_their_twin(device, name):
    filter = as_filter(name)
    F = ViewFilter(Parallel(np.arange(3.0), BINS, PITCH), filter, device=device)
    y = white(3, BINS)
    assert relative(F(y), filter_rows(y, filter.taps(BINS, PITCH), PITCH)) <= 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_filter_is_its_own_adjoint(device, name):
    scan = Parallel(np.arange(5.0), 33, PITCH)
    F = ViewFilter(scan, as_filter(name), rows=3, gains=np.arange(5), device=device)
    assert dot_test(F, seed=6) <= 1e-6
    y = white(*F.domain)
    assert np.array_equal(F.T(y), F(y))


def test_nothing_wraps_around(device):
    """A single bin shows the kernel, at either end of the detector, and nothing else."""
    F = ViewFilter(Parallel([0.0, 1.0], BINS, PITCH), Ramp(), device=device)
    ends = np.zeros((2, BINS))
    ends[0, 0] = ends[1, -1] = 1
    h = PITCH * ramp_taps(BINS, PITCH).astype(np.float32)
    np.testing.assert_allclose(F(ends), [h[BINS - 1 :], h[:BINS]], rtol=1e-6, atol=1e-12)


def test_rows_do_not_mix(device):
    F = ViewFilter(Parallel(np.arange(3.0), 40), Ramp("hann"), rows=7, device=device)
    y = white(3, 7, 40)
    y[1, 4] = 0
    assert not F(y)[1, 4].any()
    one = ViewFilter(Parallel([0.0], 40), Ramp("hann"), device=device)
    assert np.array_equal(F(y)[2, 3], one(y[2, 3][None])[0])


@pytest.mark.parametrize("bins", [1, 2, 3, 64, 65])
def test_the_ramp_has_its_exact_taps(bins):
    np.testing.assert_allclose(Ramp().taps(bins, PITCH), ramp_taps(bins, PITCH), atol=1e-15)


def test_the_windowed_ramp_has_its_exact_taps():
    """But for the ramp's taps beyond the row's end, which the window smears by O(1 / bins^2)."""
    taps = Ramp("shepp-logan").taps(BINS, PITCH)
    np.testing.assert_allclose(taps, shepp_logan_taps(BINS, PITCH), atol=1e-5)


@pytest.mark.parametrize("bins", [10, 50, 333])
def test_a_constant_row_almost_vanishes(bins):
    """The taps that the row's end cuts off add up to 1 / (pi^2 bins): no other offset is there."""
    sum_of_taps = PITCH**2 * Ramp().taps(bins, PITCH).sum()
    assert sum_of_taps == pytest.approx(1 / (np.pi**2 * bins), rel=0.11)


@pytest.mark.parametrize("cutoff", [1.0, 0.5, 0.21])
@pytest.mark.parametrize("window", AT_NYQUIST)
def test_windows_have_their_response(window, cutoff):
    u = {
        "ram-lak": lambda u: 1.0,
        "shepp-logan": lambda u: np.sin(np.pi * u / 2) / (np.pi * u / 2),
        "cosine": lambda u: np.cos(np.pi * u / 2),
        "hamming": lambda u: 0.54 + 0.46 * np.cos(np.pi * u),
        "hann": lambda u: np.cos(np.pi * u / 2) ** 2,
    }[window]
    end = cutoff * NYQUIST
    taps = Ramp(window, cutoff).taps(BINS, PITCH)
    inside = np.linspace(0.05, 0.85, 40) * end
    expected = inside * u(inside / end)
    np.testing.assert_allclose(response(taps, PITCH, inside), expected, atol=0.006 * NYQUIST)
    outside = np.linspace(1.2 * end, NYQUIST, 40) if cutoff < 1 else np.array([])
    np.testing.assert_allclose(response(taps, PITCH, outside), 0, atol=0.006 * NYQUIST)


@pytest.mark.parametrize("window", AT_NYQUIST)
def test_windows_at_nyquist(window):
    there = response(Ramp(window).taps(BINS, PITCH), PITCH, [NYQUIST]) / NYQUIST
    assert there == pytest.approx(AT_NYQUIST[window], abs=0.005)


def test_the_high_pass_meets_the_ramp_at_one():
    assert relative(HighPass(1).taps(BINS, PITCH), ramp_taps(BINS, PITCH)) < 1e-3


def test_the_high_pass_at_zero_is_the_identity(device):
    """At the scale that every exponent has, the ramp's value at the Nyquist frequency."""
    F = ViewFilter(Parallel([0.0, 1.0], BINS, PITCH), HighPass(0), device=device)
    y = white(2, BINS)
    assert relative(F(y), NYQUIST * y) < 1e-6


@pytest.mark.parametrize("exponent", [0.5, 1.5, 2])
def test_the_high_pass_has_its_response(exponent):
    taps = HighPass(exponent).taps(BINS, PITCH)
    f = np.linspace(0.1, 0.95, 30) * NYQUIST
    expected = NYQUIST * (f / NYQUIST) ** exponent
    np.testing.assert_allclose(response(taps, PITCH, f), expected, atol=0.006 * NYQUIST)


def test_any_response_is_a_filter():
    def gaussian(f):
        return f**2 * np.exp(-((f / 0.3) ** 2))

    filter = as_filter(gaussian)
    assert isinstance(filter, Response)
    assert relative(filter.taps(BINS, PITCH), response_taps(gaussian, BINS, PITCH)) < 1e-4
    assert relative(as_filter(lambda f: f).taps(BINS, PITCH), ramp_taps(BINS, PITCH)) < 1e-3


def test_finer_bins_pass_what_the_wider_hold():
    finer, cut = Finer(Ramp("hann"), 2).taps(60, 0.5), Ramp("hann", 0.5).taps(60, 0.5)
    np.testing.assert_allclose(finer, cut, atol=1e-3 * cut.max())
    assert finer.sum() == pytest.approx(Ramp("hann").taps(30, 1.0).sum() * 2, abs=1e-2)


def test_the_pitch_is_a_length():
    """In another unit of length taps go as 1 / length^2, responses as 1 / length."""
    for filter in (Ramp(), Ramp("hann", 0.5), HighPass(0.5)):
        np.testing.assert_allclose(filter.taps(30, 0.25), 16 * filter.taps(30, 1.0), rtol=1e-9)
    np.testing.assert_allclose(
        Response(lambda f: f).taps(30, 0.25), 16 * Response(lambda f: f).taps(30, 1.0), rtol=1e-9
    )


def test_filters_are_taken_as_they_are():
    for filter in (Ramp("hann", 0.3), HighPass(0.2), Response(np.sqrt)):
        assert as_filter(filter) is filter
    assert as_filter("hann") == Ramp("hann")
    assert as_filter("high-pass") == HighPass()


def test_a_filter_of_ones_own_has_a_name(device):
    def soft(frequency):
        return frequency / (1 + frequency)

    register_filter("own", soft)
    try:
        assert np.array_equal(as_filter("own").taps(9, 0.5), Response(soft).taps(9, 0.5))
        A = Projector(Grid((8, 8)), Parallel(np.arange(6.0), 13), device=device)
        y = white(6, 13)
        assert np.array_equal(fbp(A, y, "own"), fbp(A, y, soft))
        for name in ("own", "hann"):
            with pytest.raises(InputError, match=f"{name}.*already"):
                register_filter(name, np.sqrt)
    finally:
        FILTERS.remove("own")
    with pytest.raises(InputError, match="own"):
        as_filter("own")
    for nothing in ("hann", 3):
        with pytest.raises(InputError, match=repr(nothing)):
            register_filter("other", nothing)


@pytest.mark.parametrize("name", ["nope", "", "Ram-Lak", "ramp "])
def test_an_unknown_name_lists_every_name(name):
    with pytest.raises(InputError, match=repr(name)) as caught:
        as_filter(name)
    assert all(known in str(caught.value) for known in NAMES)


@pytest.mark.parametrize("filter", [None, 3, ["hann"], np.ones(5)])
def test_what_is_no_filter_is_refused(filter):
    with pytest.raises(InputError, match="filter"):
        as_filter(filter)


@pytest.mark.parametrize("cutoff", [0, -1, 1.01, np.nan, np.inf])
def test_cutoffs_outside_the_detector_are_refused(cutoff):
    with pytest.raises(InputError, match="cutoff"):
        Ramp("hann", cutoff)


@pytest.mark.parametrize("exponent", [-0.1, np.nan, np.inf])
def test_exponents_without_a_meaning_are_refused(exponent):
    with pytest.raises(InputError, match="exponent"):
        HighPass(exponent)


@pytest.mark.parametrize(
    "function",
    [
        lambda f: f[:-1],
        lambda f: 1.0,
        lambda f: np.where(f > 0.1, np.nan, f),
        lambda f: f * np.inf,
        lambda f: f * 1e40,
        lambda f, cutoff: f,
        lambda f: 1j * f,
        lambda f: ["a"] * len(f),
        lambda f: None,
    ],
)
def test_responses_that_are_no_finite_numbers_are_refused(function):
    with pytest.raises(InputError, match="response"):
        Response(function).taps(10, 1.0)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda f: f / (1 + (f / 0.3) ** 8), "keeps 0.00.* % of the ramp .* cycles per bin"),
        (lambda f: 1 / (1 + f), "times the ramp"),
        (lambda f: -f, "is -1 times the ramp"),
        (np.zeros_like, "keeps 0 % of the ramp"),
        (lambda f: 2 * f, "is 2 times the ramp"),
        (lambda f: 0.7 * f * (f < 9), "is 0.7 times the ramp"),
    ],
)
def test_responses_that_are_no_ramp_are_doubted(device, function, said):
    """Bins of 0.01: the first of these was written for bins of 1."""
    A = Projector(Grid((8, 8), 0.01), Parallel(np.arange(6.0), 13, pitch=0.01), device=device)
    with pytest.warns(UserWarning, match=said):
        fbp(A, white(6, 13), function)


def test_a_response_may_change_the_frequencies_that_it_is_given():
    def in_place(frequencies):
        frequencies *= np.cos(frequencies)
        frequencies[0] = 0
        return frequencies

    response = Response(in_place)
    assert response.doubt(BINS, 1.0) is None
    aside = Response(lambda f: in_place(f.copy()))
    assert response.taps(BINS, 1.0).tobytes() == aside.taps(BINS, 1.0).tobytes()


@pytest.mark.full
def test_a_cone_doubts_responses_as_parallel_beams_do(device):
    scan = Fan(np.linspace(0, 2 * np.pi, 8, endpoint=False), 13, 0.01, 2, 4)
    A = Projector(Grid((8, 8), 0.01), scan, device=device)
    with pytest.warns(UserWarning, match="is -1 times the ramp"):
        fbp(A, white(8, 13), lambda f: -f)


def test_ramps_of_ones_own_are_not_doubted(device, recwarn):
    A = Projector(Grid((8, 8), 0.01), Parallel(np.arange(6.0), 13, pitch=0.01), device=device)
    for function in (lambda f: f, lambda f: f * np.cos(f / f.max()), lambda f: 1.1 * f * (f < 9)):
        fbp(A, white(6, 13), function)
    fbp(A, white(6, 13), "high-pass")
    fbp(A, white(6, 13), HighPass(0.3))
    assert not [str(each.message) for each in recwarn if "ramp" in str(each.message)]


@pytest.mark.parametrize("bins", [16, 91])
@pytest.mark.parametrize("cutoff", [0.2, 1.0])
@pytest.mark.parametrize("window", WINDOWS)
def test_the_windows_as_ones_own_responses_are_not_doubted(window, cutoff, bins):
    def windowed(f):
        share = f / f.max() / cutoff
        return f * WINDOWS[window](share) * (share <= 1)

    assert Response(windowed).doubt(bins, 0.3) is None


def test_a_ramp_interpolated_between_its_transformed_samples_is_not_doubted():
    taps, pitch = ramp_taps(BINS, 0.3), 0.3
    values = np.abs(np.fft.rfft(taps)) * pitch
    sampled = np.arange(values.size) / (taps.size * pitch)
    assert Response(lambda f: np.interp(f, sampled, values)).doubt(BINS, pitch) is None


@pytest.mark.parametrize("gains", [[1, 2], np.ones((3, 1)), 1.0])
def test_gains_that_do_not_fit_are_refused(device, gains):
    with pytest.raises(ShapeError, match="gains has shape"):
        ViewFilter(Parallel(np.arange(3.0), 5), Ramp(), gains=gains, device=device)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_gains_must_be_finite(device, bad):
    with pytest.raises(InputError, match="gains"):
        ViewFilter(Parallel([0.0, 1.0], 5), Ramp(), gains=[1, bad], device=device)


@pytest.mark.parametrize("rows", [0, -1])
def test_rows_must_be_there(device, rows):
    with pytest.raises(InputError, match="rows"):
        ViewFilter(Parallel([0.0, 1.0], 5), Ramp(), rows=rows, device=device)


def test_detectors_that_the_host_has_no_memory_for_are_refused(monkeypatch):
    monkeypatch.setattr("rift_cl.cl.budget.host_budget", lambda: 1 << 30)
    grid, angles, bins = Grid((8, 8)), np.arange(6.0), 2**31
    with pytest.raises(ResourceLimitError, match="filter of 2147483648 bins"):
        ViewFilter(Parallel(angles, bins), Ramp())
    with pytest.raises(ResourceLimitError, match="detector of 2147483648 bins"):
        Projector(grid, Fan(angles, bins, 1e-9, 100, 200))
