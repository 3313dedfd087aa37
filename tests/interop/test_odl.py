"""ODL's operators and ours are each other's, with the weights of ODL's spaces."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.interop.odl import from_odl, to_odl

# ODL warns of what Python and NumPy have given up.
pytestmark = [pytest.mark.once, pytest.mark.filterwarnings("ignore")]


@pytest.fixture(scope="module")
def odl():
    return pytest.importorskip("odl", reason="ODL is not installed")


def projector(device, grid=None):
    grid = rift.Grid((6, 7)) if grid is None else grid
    return rift.Projector(grid, rift.Parallel(np.linspace(0, 3, 8), 9), device=device)


def grid_of(space):
    """The grid that samples where a space of functions of y and x does; a plain one otherwise."""
    if not hasattr(space, "partition"):
        return rift.Grid(space.shape)
    middles = [(places[0] + places[-1]) / 2 for places in space.grid.coord_vectors]
    return rift.Grid(space.shape, tuple(space.cell_sides), tuple(middles))


def white(*shape):
    return np.random.default_rng(5).standard_normal(shape).astype(np.float32)


def test_our_operator_between_plain_spaces(device, odl):
    A, x, y = projector(device), white(6, 7), white(8, 9)
    P = to_odl(A)
    assert np.array_equal(P(P.domain.element(x)).asarray(), A(x))
    assert np.array_equal(P.adjoint(P.range.element(y)).asarray(), A.T(y))
    assert np.array_equal(P.adjoint.adjoint(P.domain.element(x)).asarray(), A(x))


def test_the_adjoint_holds_between_weighted_spaces(device, odl):
    A = projector(device)
    domain = odl.uniform_discr([-3, -3.5], [3, 3.5], (6, 7), dtype="float32")
    range = odl.uniform_discr([0, -4], [3, 4], (8, 9), dtype="float32")
    P = to_odl(A, domain=domain, range=range)
    x, y = domain.element(white(6, 7)), range.element(white(8, 9))
    assert np.isclose(P(x).inner(y), x.inner(P.adjoint(y)), rtol=1e-4)
    assert rift.dot_test(from_odl(P, device=device)) < 1e-6


def spaces_of(odl, kind):
    """A domain and a range whose inner products weigh samples unlike each other."""
    if kind == "weights":
        each = [1 + np.random.default_rng(3).random(shape) for shape in ((6, 7), (8, 9))]
        return [odl.rn(w.shape, dtype="float32", weighting=np.float32(w)) for w in each]
    if kind == "parts":
        line = odl.uniform_discr(0, 3, 7, dtype="float32", nodes_on_bdry=True)
        weighting = [1.0, 2, 3, 1, 2, 3]
        return odl.ProductSpace(line, 6, weighting=weighting), odl.rn((8, 9), dtype="float32")
    edge = {"dtype": "float32", "nodes_on_bdry": kind == "nodes" or [True, (False, True)]}
    return (
        odl.uniform_discr([-3, -3.5], [3, 3.5], (6, 7), **edge),
        odl.uniform_discr([0, -4], [3, 4], (8, 9), **edge),
    )


@pytest.mark.each
@pytest.mark.parametrize("kind", ["nodes", "one edge", "weights", "parts"])
def test_the_adjoint_holds_where_samples_have_weights_of_their_own(device, odl, kind):
    domain, range = spaces_of(odl, kind)
    A = projector(device, grid_of(domain))
    P = to_odl(A, domain=domain, range=range)
    x, y = domain.element(white(6, 7)), range.element(white(8, 9))
    np.testing.assert_allclose(P(x).asarray(), A(white(6, 7)), rtol=1e-6)
    assert np.isclose(P(x).inner(y), x.inner(P.adjoint(y)), rtol=1e-4)
    again = P.adjoint.adjoint(x).asarray()
    np.testing.assert_allclose(again, P(x).asarray(), rtol=1e-4, atol=1e-5)
    # The other way round ODL's own operators keep one weight alone.
    with pytest.raises(DTypeError, match="the domain of P has a weight for each sample"):
        from_odl(P, device=device)


def test_spaces_that_our_operators_know_nothing_of_are_refused(device, odl):
    A = projector(device)
    for space in (
        odl.cn((6, 7)),
        odl.uniform_discr([0, 0], [1, 1], (6, 7), dtype="complex64"),
        odl.tensor_space((6, 7), dtype="int32"),
    ):
        with pytest.raises(DTypeError, match=f"domain is a space of {space.dtype}.*real"):
            to_odl(A, domain=space)
    with pytest.raises(DTypeError, match="range is a space of complex"):
        to_odl(A, range=odl.cn((8, 9)))
    own = odl.rn((8, 9), dtype="float32", inner=lambda x, y: 3.0)
    with pytest.raises(DTypeError, match="range has a CustomInner as its inner product"):
        to_odl(A, range=own)
    with pytest.raises(DTypeError, match="domain has no inner product"):
        to_odl(A, domain=odl.rn((6, 7), dtype="float32", exponent=1.0))


def test_a_function_of_x_and_y_is_projected_where_it_is(device, odl):
    """A blob at (2, -0.5) lies at x in the first view, and at y a quarter of a turn on."""
    grid = rift.Grid((8, 12), spacing=(0.5, 1.0), center=(0.0, 1.0))
    scan = rift.Parallel([0.0, np.pi / 2], 41, 0.25)
    A = rift.Projector(grid, scan, device=device)
    space = odl.uniform_discr([-5, -2], [7, 2], (12, 8), dtype="float32")
    f = space.element(lambda p: np.exp(-2 * ((p[0] - 2) ** 2 + (p[1] + 0.5) ** 2)))
    P = to_odl(A, domain=space, axes="xy")
    y = P(f).asarray()
    np.testing.assert_allclose(y @ scan.coordinates() / y.sum(axis=1), [2, -0.5], atol=0.05)
    assert np.array_equal(y, A(f.asarray().T))
    v = P.range.element(white(2, 41))
    assert np.isclose(P(f).inner(v), f.inner(P.adjoint(v)), rtol=1e-4)
    assert to_odl(A, axes="xy").domain.shape == (12, 8)


def test_functions_that_are_sampled_elsewhere_than_the_grid_are_refused(device, odl):
    A, ends = projector(device), ([-3, -3.5], [3, 3.5])
    for low, high, axis in (
        ([-1, -3.5], [1, 3.5], "y"),
        ([-3, 0], [3, 7], "x"),
        ([-3.5, -3], [3.5, 3], "y"),
    ):
        with pytest.raises(InputError, match=f"domain samples {axis} from"):
            to_odl(A, domain=odl.uniform_discr(low, high, (6, 7), dtype="float32"))
    with pytest.raises(InputError, match="nodes on the boundary"):
        to_odl(A, domain=odl.uniform_discr(*ends, (6, 7), dtype="float32", nodes_on_bdry=True))
    with pytest.raises(InputError, match="A does not say that its domain is an image"):
        to_odl(A.T, axes="xy")
    with pytest.raises(InputError, match="axes is 'zx'"):
        to_odl(A, axes="zx")


def test_their_solver_takes_our_operator(device, odl):
    A, x = projector(device), white(6, 7)
    P = to_odl(A)
    found = P.domain.zero()
    odl.solvers.conjugate_gradient_normal(P, found, P.range.element(A(x)), niter=60)
    assert np.linalg.norm(A(found.asarray()) - A(x)) < 1e-2 * np.linalg.norm(A(x))


def test_their_operator_goes_into_our_algebra(device, odl):
    space = odl.uniform_discr([-3, -3.5], [3, 3.5], (6, 7), dtype="float32")
    D = odl.PartialDerivative(space, axis=0)
    ours, x = from_odl(D, device=device), white(6, 7)
    assert np.allclose(ours(x), D(space.element(x)).asarray(), atol=1e-6)
    assert rift.dot_test(ours) < 1e-6
    assert rift.dot_test(projector(device) @ ours) < 1e-5


def test_their_gradient_goes_into_our_algebra(device, odl):
    space = odl.uniform_discr([-3, -3.5], [3, 3.5], (6, 7), dtype="float32")
    G = odl.Gradient(space)
    ours, x = from_odl(G, device=device), white(6, 7)
    assert ours.range == (2, 6, 7)
    np.testing.assert_allclose(ours(x), G(space.element(x)).asarray(), atol=1e-6)
    assert rift.dot_test(ours) < 1e-6
    assert rift.dot_test(rift.vstack([ours, projector(device)])) < 1e-5


def test_what_does_not_fit_is_named(device, odl):
    with pytest.raises(ShapeError, match="domain has shape"):
        to_odl(projector(device), domain=odl.rn((7, 6), dtype="float32"))
    with pytest.raises(DTypeError, match="A is a int"):
        to_odl(3)
    with pytest.raises(DTypeError, match="P is a ndarray, wanted a linear operator of ODL"):
        from_odl(np.eye(3), device=device)
    space = odl.uniform_discr([0, 0], [1, 1], (4, 4))
    both = odl.BroadcastOperator(odl.Gradient(space), odl.IdentityOperator(space))
    with pytest.raises(DTypeError, match="product of unlike spaces"):
        from_odl(both, device=device)
    uneven = odl.ProductSpace(space, 2, weighting=[1.0, 3.0])
    with pytest.raises(DTypeError, match="one for all"):
        from_odl(odl.Gradient(space, range=uneven), device=device)
    with pytest.raises(DTypeError, match="exponent 2"):
        from_odl(odl.Gradient(space, range=odl.ProductSpace(space, 2, exponent=1)), device=device)
