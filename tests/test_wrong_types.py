"""What is of a type that makes no sense is refused by its name, not found out by chance."""

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, WrongTypeError, check_type, checked_flag
from rift_cl.reconstruct import OrderedSubsets
from rift_cl.reconstruct.preprocess import remove_zingers
from rift_cl.reconstruct.preprocess.paganin import Propagation
from rift_cl.reconstruct.preprocess.rings import LargeStripes
from rift_cl.sampling import KeepOut, Sphere
from rift_cl.train import DefaultSettings, PixelLoss

GRID = rift.Grid((8, 8))
SCAN = rift.Parallel(np.arange(6) * np.pi / 6, 12)
ZEROS = np.zeros((3, 3))
CALLS = {
    "device": lambda wrong: rift.Projector(GRID, SCAN, device=wrong),
    "grid": lambda wrong: rift.cheapest_projector(wrong, SCAN),
    "A": rift.dot_test,
    "settings": rift.Renderer,
    "means": lambda wrong: rift.Splats(wrong, wrong, wrong, wrong),
    "target": lambda wrong: rift.plan(wrong, 1),
    "constraints": lambda wrong: rift.plan(target(), 1, wrong),
    "cameras": lambda wrong: rift.plan(target(), 1, cameras=wrong),
    "taken": lambda wrong: rift.next_views(wrong, target(), 1),
    "ranges": lambda wrong: rift.Constraints(ranges=wrong),
    "keepouts": lambda wrong: rift.Constraints(keepouts=wrong),
    "cutoff": lambda wrong: rift.Ramp(cutoff=wrong),
    "exponent": rift.HighPass,
}


A, ONES = rift.Projector(GRID, SCAN), np.ones((6, 12), np.float32)
FLAGS = {
    "sirt: nonnegative": lambda flag: rift.sirt(A, ONES, steps=1, nonnegative=flag),
    "sirt of subsets: nonnegative": lambda flag: OrderedSubsets(
        A, ONES, subsets=2, nonnegative=flag
    ),
    "tv: nonnegative": lambda flag: rift.tv(A, ONES, 0.1, steps=1, nonnegative=flag),
    "fista: nonnegative": lambda flag: rift.tv(
        A, ONES, 0.1, steps=1, nonnegative=flag, method="fista"
    ),
    "cheapest_projector: iterative": lambda flag: rift.cheapest_projector(
        GRID, SCAN, iterative=flag
    ),
    "remove_zingers: dark": lambda flag: remove_zingers(ONES, dark=flag),
    "LargeStripes: normalise": lambda flag: LargeStripes(normalise=flag),
    "phase retrieval: generalised": lambda flag: Propagation(1e-6, 0.1, 20, 100, flag),
    "calibrate: orbit": lambda flag: rift.calibrate(ONES, SCAN, orbit=flag),
    "plan: compare": lambda flag: rift.plan(target(), 1, compare=flag),
    "KeepOut: hides": lambda flag: KeepOut(Sphere((0, 0, 0), 1), flag),
    "filter 'own': replace": lambda flag: rift.register_filter("own", np.sqrt, replace=flag),
    "SplatSettings: antialiased": lambda flag: rift.SplatSettings(antialiased=flag),
    "DefaultSettings: absgrad": lambda flag: DefaultSettings(absgrad=flag),
    "PixelLoss: surrogate": lambda flag: PixelLoss("d", "m", surrogate=flag),
    "open_scan: reversed": lambda flag: rift.open_scan("none.h5", reversed=flag),
}


def target():
    return rift.Target((0.0, 0.0, 0.0), 1.0)


@pytest.mark.each
@pytest.mark.parametrize("name", CALLS)
def test_an_argument_of_a_wrong_type_is_named(name):
    with pytest.raises(WrongTypeError, match=rf"\b{name}\b"):
        CALLS[name](object())


@pytest.mark.each
@pytest.mark.parametrize("name", FLAGS)
def test_a_word_is_no_truth_value(name):
    with pytest.raises(InputError, match=f"{name.split()[-1]} is 'no', wanted True or False"):
        FLAGS[name]("no")


def test_truth_values_of_numpy_are_some():
    given = (True, False, np.True_, np.array(False))
    assert [checked_flag("f", "x", each) for each in given] == [True, False, True, False]


def test_other_targets_than_targets_are_named():
    with pytest.raises(WrongTypeError, match="target"):
        rift.merit([], ZEROS)
    with pytest.raises(WrongTypeError, match="target"):
        rift.coverage([], ZEROS)


def test_the_sentence_says_what_was_given_and_what_is_wanted():
    with pytest.raises(WrongTypeError, match=r"f: x is 'a'.*str.*wanted int"):
        check_type("f", "x", "a", int)
    check_type("f", "x", True, int)


@pytest.mark.parametrize(
    ("value", "wanted", "words"),
    [
        (np.ones(2), Real, "a number"),
        (True, Real, "a number"),
        (True, Integral, "a whole number"),
        (np.array(0.5), Integral, "a whole number"),
        ("views", Sequence, "a list"),
        ("balls", Iterable, "a list"),
        (3, Mapping, "a dict"),
    ],
)
def test_what_is_wanted_is_said_in_plain_words(value, wanted, words):
    with pytest.raises(WrongTypeError, match=words):
        check_type("f", "x", value, wanted)


def test_an_array_without_axes_is_a_number():
    assert rift.Ramp(cutoff=np.array(0.5)) == rift.Ramp(cutoff=0.5)
    assert rift.HighPass(np.array(2)) == rift.HighPass(2)
    check_type("f", "x", np.array(3), Integral)
