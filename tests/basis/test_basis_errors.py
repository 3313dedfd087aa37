"""What cannot be is refused in one sentence that says what was wanted; and bases have names."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from rift_cl.basis import BASES, Gaussian, Hermite, Laguerre, SquaredHermite
from rift_cl.errors import BasisSpanError, DTypeError, InputError, NonFiniteError, ShapeError


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Hermite(65), "Hermite: order is 65"),
        (lambda: Hermite(-1), "Hermite: order is -1"),
        (lambda: Hermite(1.0), "Hermite: order is 1.0"),
        (lambda: Hermite(True), "Hermite: order is True"),
        (lambda: Hermite(2, 4), "Hermite: dim is 4"),
        (lambda: Hermite(2, 2, "square"), "truncation is 'square'"),
        (lambda: Hermite(2, form="elegant"), "form is 'elegant'"),
        (lambda: Hermite(2, form=["der"]), "form is"),
        (lambda: Hermite(22, 3, "row"), "from 0 to 21: row s reaches total order 3 s"),
        (lambda: Laguerre(65), "Laguerre: order is 65"),
        (lambda: Laguerre(33, truncation="row"), "from 0 to 32: row s reaches total order 2 s"),
        (lambda: Laguerre(2, "polar"), "kind is 'polar'"),
        (lambda: SquaredHermite(9), "from 0 to 8: its square has order 2 N"),
        (lambda: SquaredHermite(2, 0), "SquaredHermite: dim is 0"),
        (lambda: Gaussian(4), "Gaussian: dim is 4"),
        (lambda: BASES["gabor"], "wanted one of gaussian, hermite, laguerre"),
    ],
)
def test_impossible_settings_are_refused(make, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


BASES_OF_SIX = [Hermite(2), Laguerre(2), Laguerre(2, "complex"), SquaredHermite(2)]


@pytest.mark.parametrize("basis", BASES_OF_SIX, ids=str)
@pytest.mark.parametrize(
    ("coeff", "x", "kind", "words"),
    [
        (np.ones(5), [0.0, 0.0], ShapeError, r"has shape \(5,\)"),
        (1.0, [0.0, 0.0], ShapeError, r"has shape \(\)"),
        (np.full(6, math.nan), [0.0, 0.0], NonFiniteError, r"coeff of .* holds NaN"),
        (["a"] * 6, [0.0, 0.0], DTypeError, "coeff of .* has type"),
        (np.ones(6), [0.0, 0.0, 0.0], ShapeError, r"x has shape \(3,\)"),
        (np.ones(6), [0.0, math.inf], NonFiniteError, "x holds NaN"),
        (np.ones(6), [1j, 0], DTypeError, "x has type complex128"),
        (np.ones((3, 6)), np.zeros((4, 2)), ShapeError, r"\(3, 6\) and \(4, 2\)"),
        (np.ones(6), [[0.0, 1.0], [2.0]], DTypeError, "x cannot be read as an array of numbers"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(basis, coeff, x, kind, words: str) -> None:
    with pytest.raises(kind, match=words):
        basis.evaluate(coeff, x)


def test_a_span_error_is_an_input_error() -> None:
    """The command line turns it into a sentence and exit status 3, as it does any bad input."""
    assert issubclass(BasisSpanError, InputError) and BasisSpanError.exit_status == 3


def test_no_points_are_no_values() -> None:
    for basis in BASES_OF_SIX:
        assert basis.evaluate(np.ones(6), np.zeros((0, 2))).shape == (0,)


@pytest.mark.parametrize("name", sorted(BASES))
def test_every_basis_is_found_by_its_name_and_does_all_of_the_protocol(name: str) -> None:
    kind = BASES[name]
    basis = kind() if name == "gaussian" else kind(2)
    assert basis.name == name
    assert (basis.dim, basis.truncation, basis.form) == (2, "total", "der")
    assert len(basis.indices()) == basis.n_coeff
    coeff, A = np.eye(basis.n_coeff)[0], np.array([[1.0, 0.0]])
    assert basis.evaluate(coeff, [0.0, 0.0]) == pytest.approx(1, abs=1e-15)
    assert basis.evaluate(coeff, [0.0, 0.0], grad=True).dx.tolist() == [0, 0]
    assert basis.convert(coeff, Hermite(4))[0] == 1
    flat = basis.project(coeff, A)
    assert flat[0] == 1 and not flat[1:].any()
    assert [part.shape for part in basis.project_vjp(coeff, A, flat)] == [coeff.shape, A.shape]
    assert basis.fourier(coeff, [0.0, 0.0]) == pytest.approx(2 * math.pi)
    np.testing.assert_allclose(basis.rotate(coeff, 1.0), coeff, atol=1e-15)
    assert basis.gram().shape == (basis.n_coeff, basis.n_coeff)
    assert basis.cull_radius(coeff, 1 / 255) == pytest.approx(3.33, abs=0.01)
    assert pickle.loads(pickle.dumps(basis)) == basis
