"""Operators in torch: the values are the operator's own, derivatives of every order are right."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import (
    DeviceError,
    DTypeError,
    InputError,
    NonFiniteError,
    RiftError,
    ShapeError,
)
from rift_cl.reconstruct import FilteredBackprojection

torch = pytest.importorskip("torch", reason="torch is not installed")
from rift_cl.interop.linear_torch import apply  # noqa: E402 - needs torch

pytestmark = pytest.mark.once

# torch's own forward mode compiles with what torch itself has given up.
forward_mode = pytest.mark.filterwarnings("ignore:.*torch.jit.script:DeprecationWarning")


def projector(device, dtype="float32"):
    grid, scan = rift.Grid((6, 7)), rift.Parallel(np.linspace(0, 3, 5), 9)
    return rift.Projector(grid, scan, device=device, dtype=dtype)


def white(*shape, dtype=torch.float32, **options):
    generator = torch.Generator().manual_seed(3)
    return torch.randn(*shape, dtype=dtype, generator=generator, **options)


@pytest.mark.parametrize(
    "solve",
    [
        lambda A, y: rift.cgls(A, y, steps=2),
        lambda A, y: rift.sirt(A, y, steps=2),
        lambda A, y: rift.tv(A, y, weight=0.1, steps=2),
    ],
    ids=["cgls", "sirt", "tv"],
)
def test_a_solver_gives_a_tensor_for_a_tensor(device, solve):
    A, y = projector(device), white(5, 9)
    found = solve(A, y)
    assert isinstance(found, torch.Tensor)
    assert np.array_equal(found.numpy(), solve(A, y.numpy()))
    with pytest.raises(DTypeError, match="detach"):
        solve(A, y.requires_grad_())


@pytest.fixture
def exact(device):
    """A small projector in float64, for finite differences."""
    if not device.traits.fp64:
        pytest.skip("the device has no float64")
    scan = rift.Parallel(np.linspace(0.1, 3, 3), 5)
    return rift.Projector(rift.Grid((3, 4)), scan, device=device, dtype="float64")


def test_a_solver_says_that_no_gradients_pass_through_it(device):
    A = projector(device)
    with pytest.raises(DTypeError, match=r"y is a tensor with requires_grad.*y\.detach\(\)"):
        rift.cgls(A, torch.zeros(A.range, requires_grad=True), steps=2)


def test_the_values_are_the_operators_own(device):
    A, x = projector(device), white(6, 7)
    assert np.array_equal(apply(A, x).numpy(), A(x.numpy()))
    assert np.array_equal(apply(A.T, white(5, 9)).numpy(), A.T(white(5, 9).numpy()))


def test_an_operator_takes_a_tensor_as_it_takes_an_array(device):
    A, x, y = projector(device), white(6, 7, requires_grad=True), white(5, 9)
    assert torch.equal(A(x), apply(A, x))
    assert torch.equal(A @ x, A(x))
    assert torch.equal(A.T(y), apply(A.T, y))
    assert A(x).requires_grad
    rift.fbp(A, y.requires_grad_()).sum().backward()
    assert y.grad.shape == y.shape
    with pytest.raises(RiftError, match="out is given"):
        A(x, out=np.empty((5, 9), np.float32))
    with pytest.raises(ShapeError, match="y has shape"):
        rift.fbp(A, y[0])


def test_leading_dimensions_are_a_batch(device):
    A, x = projector(device), white(2, 3, 6, 7)
    y = apply(A, x)
    assert y.shape == (2, 3, 5, 9)
    assert torch.equal(y[1, 2], apply(A, x[1, 2]))
    assert apply(A, x[:0]).shape == (0, 3, 5, 9)


def test_a_batch_of_volumes_keeps_its_order(device):
    A = rift.Projector(rift.Grid((3, 6, 7)), projector(device).scan, device=device)
    x = white(2, 3, 6, 7)
    assert apply(A, x).shape == (2, 5, 3, 9)
    assert torch.allclose(apply(A, x)[1, :, 2], apply(projector(device), x[1, 2]), atol=1e-5)


def test_strided_and_expanded_tensors_are_read_as_they_look(device):
    A, x = projector(device), white(7, 6)
    assert torch.equal(apply(A, x.T), apply(A, x.T.contiguous()))
    assert torch.equal(apply(A, x.T.expand(2, 6, 7))[1], apply(A, x.T))
    negative = torch.view_as_complex(white(6, 7, 2)).conj().imag
    assert torch.equal(apply(A, negative), apply(A, negative.clone()))


@forward_mode
def test_first_derivatives_pass_gradcheck(exact):
    x = white(2, 3, 4, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: apply(exact, x), (x,), check_forward_ad=True)


def test_second_derivatives_pass_gradgradcheck(exact):
    x = white(3, 4, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradgradcheck(lambda x: apply(exact, x) ** 2, (x,))
    assert torch.autograd.gradgradcheck(lambda x: apply(exact.T, apply(exact, x) ** 2), (x,))


def test_the_gradient_of_a_least_squares_loss_is_the_adjoint_of_the_residual(device):
    A, x, y = projector(device), white(6, 7, requires_grad=True), white(5, 9)
    (0.5 * ((apply(A, x) - y) ** 2).sum()).backward()
    expected = A.T(A(x.detach().numpy()) - y.numpy())
    assert np.allclose(x.grad.numpy(), expected, atol=1e-4)


def test_a_gradient_of_a_gradient_is_the_normal_operator(device):
    A, x, v = projector(device), white(6, 7, requires_grad=True), white(6, 7) + 1
    (first,) = torch.autograd.grad((apply(A, x) ** 2).sum(), x, create_graph=True)
    (second,) = torch.autograd.grad((first * v).sum(), x)
    assert np.allclose(second.numpy(), 2 * A.T(A(v.numpy())), atol=1e-3)


@forward_mode
def test_functional_transforms_know_the_operator(device):
    A, x = projector(device), white(3, 6, 7)
    func = torch.func
    assert torch.equal(func.vmap(lambda x: apply(A, x))(x), apply(A, x))
    assert torch.equal(func.vmap(lambda x: apply(A, x), in_dims=1)(x.movedim(0, 1)), apply(A, x))
    _, tangent = func.jvp(lambda x: apply(A, x), (x,), (2 * x,))
    assert torch.allclose(tangent, 2 * apply(A, x), atol=1e-5)
    matrix = func.jacrev(lambda x: apply(A, x))(x[0]).reshape(45, 42)
    hessian = func.hessian(lambda x: (apply(A, x) ** 2).sum())(x[0]).reshape(42, 42)
    assert torch.allclose(hessian, 2 * matrix.T @ matrix, atol=1e-4)


def test_batches_older_than_torch_func_are_told_what_to_take(device):
    A, x = projector(device), white(6, 7, requires_grad=True)
    y, every = apply(A, x), torch.eye(45).reshape(45, 5, 9)
    with pytest.raises(InputError, match=r"torch\.func"):
        torch.autograd.grad(y, x, every, is_grads_batched=True)
    with pytest.raises(InputError, match=r"torch\.func"):
        torch.autograd.functional.jacobian(lambda x: apply(A, x), x, vectorize=True)


def test_filtered_backprojection_trains_what_comes_before_it(device):
    A = projector(device)
    B = FilteredBackprojection(A)
    sinogram, gain = white(4, 5, 9), torch.ones(9, requires_grad=True)
    apply(B, gain * sinogram).sum().backward()
    expected = sum(B.T(np.ones((6, 7), np.float32)) * s for s in sinogram.numpy()).sum(0)
    assert np.allclose(gain.grad.numpy(), expected, rtol=1e-3, atol=1e-4)


def test_filtered_backprojection_passes_gradcheck(exact):
    y = white(3, 5, dtype=torch.float64, requires_grad=True)
    B = FilteredBackprojection(exact)
    assert torch.autograd.gradcheck(lambda y: apply(B, y), (y,))


def test_a_parameter_and_no_grad_behave_as_in_torch(device):
    A, parameter = projector(device), torch.nn.Parameter(white(6, 7))
    assert apply(A, parameter).requires_grad
    with torch.no_grad():
        assert not apply(A, parameter).requires_grad


def test_a_gradient_that_is_not_finite_comes_back_as_nan(device):
    A, x = projector(device), white(2, 6, 7, requires_grad=True)
    apply(A, x).backward(torch.full((2, 5, 9), float("inf")))
    assert x.grad.isnan().all()
    assert x.grad.shape == x.shape


BAD = {
    "array": (lambda x: x.numpy(), DTypeError, "x is a ndarray, wanted a torch tensor"),
    "list": (lambda x: x.tolist(), DTypeError, "x is a list"),
    "double": (lambda x: x.double(), DTypeError, r"float64.*float32.*\.float\(\)"),
    "half": (lambda x: x.half(), DTypeError, r"float16.*: call \.float\(\)$"),
    "whole numbers": (lambda x: x.int(), DTypeError, "int32"),
    "complex": (lambda x: x + 1j, DTypeError, "complex64"),
    "sparse": (lambda x: x.to_sparse(), DTypeError, r"sparse.*: call \.to_dense\(\)$"),
    "elsewhere": (lambda x: x.to("meta"), DeviceError, "meta"),
    "transposed": (lambda x: x.T, ShapeError, r"shape \(7, 6\), wanted \(6, 7"),
    "too flat": (lambda x: x[0], ShapeError, r"shape \(7,\)"),
    "scalar": (lambda x: x[0, 0], ShapeError, r"shape \(\)"),
    "NaN": (lambda x: x * float("nan"), NonFiniteError, r"x holds NaN.*42 places"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_argument_is_named(device, case):
    change, error, words = BAD[case]
    with pytest.raises(error, match=words):
        apply(projector(device), change(white(6, 7)))


def test_a_tensor_is_no_factor_of_an_operator_but_of_its_result(device):
    A, two = projector(device), torch.tensor(2.0, requires_grad=True)
    for product in (lambda: A * two, lambda: two * A):
        with pytest.raises(InputError, match=r"number of Python.*factor \* A\(x\)"):
            product()
    (two * A(white(6, 7))).sum().backward()
    assert two.grad is not None


def test_what_is_no_operator_is_named():
    with pytest.raises(RiftError, match=r"A is a Tensor"):
        apply(white(6, 7), white(6, 7))


def test_an_operator_in_float64_asks_for_double(exact):
    with pytest.raises(DTypeError, match=r"dense torch.float64.*\.double"):
        apply(exact, white(3, 4))
