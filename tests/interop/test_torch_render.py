"""Splats through torch: the kernels' bits, autograd's gradients, and named errors."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.errors import InputError
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

torch = pytest.importorskip("torch", reason="torch is not installed")
from rift_cl.interop import torch as interop  # noqa: E402 - it needs torch

pytestmark = pytest.mark.once

SIZE = (45, 61)
NAMES = ("means", "quats", "scales", "opacities")


def tensors_of(values, *, grad=False):
    return {name: torch.tensor(value, requires_grad=grad) for name, value in values.items()}


def cameras(model="pinhole", count=2):
    """Views that differ a little: matrices (V, 4, 4) and (V, 3, 3)."""
    focal = {"pinhole": 60.0, "ortho": 16.0, "fisheye": 50.0}[model]
    base = camera_of(model, focal=focal)
    views, Ks = [], []
    for number in range(count):
        view, K = base.view.copy(), base.K.copy()
        view[:3, 3] += 0.2 * number * np.array([1, -0.5, 0.3])
        K[:2, 2] = 30.3 - number, 22.7 + number
        views.append(view)
        Ks.append(K)
    return np.float32(views), np.float32(Ks)


def scene(count=60, **changes):
    values = random_splats(count, coefficients=9, wide=1.2)
    values["opacities"] = np.clip(values["opacities"], 0.05, 0.9)
    return values | changes


def render(tensors, views, Ks, **options):
    options = {"size": SIZE} | options
    shape = (tensors["means"], tensors.get("quats"), tensors.get("scales"), tensors["opacities"])
    rest = {name: tensors[name] for name in ("sh", "colors", "covars") if name in tensors}
    return interop.render(*shape, views, Ks, **rest, **options)


def relative(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@pytest.mark.parametrize("mode", ["light", "xray"])
def test_images_are_the_renderers_to_the_bit(device, mode):
    values, (views, Ks), settings = scene(), cameras(), SplatSettings(mode=mode)
    behind = np.float32([[0.1, 0.4, 0.8], [0.9, 0.2, 0.3]])
    images, alphas = render(
        tensors_of(values), *map(torch.tensor, (views, Ks)), settings=settings, device=device,
        backgrounds=torch.tensor(behind) if mode == "light" else None,
    )  # fmt: skip
    renderer = rift.Renderer(settings, device=device)
    for number, camera in enumerate(map(lambda v, K: rift.Camera(SIZE, K, v), views, Ks)):
        splats = Splats.upload(device, **values)
        frame = renderer.forward(splats, camera, background=device.array(behind[number]))
        assert np.array_equal(images[number].numpy(), device.get(frame.image))
        alpha = 1 - device.get(frame.transmittance)
        assert np.array_equal(alphas[number, ..., 0].numpy(), alpha)


def oracle(values, views, Ks, model, settings, *, depth=None, behind=None):
    """Images and alphas in float64 torch, of the same arguments, with leaves by name."""
    import twin_projection as twin

    leaves = {n: torch.tensor(v.astype(float), requires_grad=True) for n, v in values.items()}
    leaves["viewmats"] = torch.tensor(views.astype(float), requires_grad=True)
    leaves["Ks"] = torch.tensor(Ks.astype(float), requires_grad=True)
    leaves["backgrounds"] = torch.tensor(behind.astype(float), requires_grad=True)
    images = []
    for number in range(len(views)):
        camera = rift.Camera(SIZE, Ks[number], views[number], model)
        view, K = leaves["viewmats"][number][:3], leaves["Ks"][number]
        lens = torch.stack([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
        covars = twin.covariance(leaves["quats"], leaves["scales"])
        placed = (leaves["means"], covars, leaves["opacities"], view, lens)
        seen = twin.screen(*placed, camera=camera, settings=settings)
        features = twin.shade(leaves["means"], leaves["sh"], view, model)
        images.append(_composite(seen, features, leaves["backgrounds"][number], settings, depth))
    return torch.stack(images), leaves


def _composite(seen, features, behind, settings, depth):
    """Every pixel and every splat, front to back, with smooth cut-offs: no tiles, no thresholds."""
    from rift_cl.reference.splat_raster import SMOOTH_EDGE

    pixels, conics, weights, depths = seen
    if depth:
        features = torch.cat([features, depths[:, None]], 1)
        behind = torch.cat([behind, behind.new_zeros(1)])
    y, x = (torch.arange(n, dtype=torch.float64) + 0.5 for n in SIZE)
    color = torch.zeros(*SIZE, features.shape[1], dtype=torch.float64)
    left = torch.ones(SIZE, dtype=torch.float64)
    for i in torch.argsort(depths.float(), stable=True).tolist():
        dx, dy = pixels[i, 0] - x, pixels[i, 1] - y[:, None]
        a, b, c = conics[i, 0, 0], conics[i, 0, 1], conics[i, 1, 1]
        sigma = (a * dx**2 + c * dy**2) / 2 + b * dx * dy
        fade = torch.clamp(1 - sigma / SMOOTH_EDGE, min=0) ** 2
        alpha = weights[i] * torch.exp(-sigma) * fade
        if settings.mode == "xray":
            color = color + alpha[..., None] * features[i]
            continue
        color = color + (alpha * left)[..., None] * features[i]
        left = left * (1 - alpha)
    if settings.mode == "light":
        color = color + left[..., None] * behind
    if depth == "expected":
        last = color[..., -1:] / torch.clamp(1 - left, min=1e-10)[..., None]
        color = torch.cat([color[..., :-1], last], -1)
    return color


WAYS = {
    "pinhole": ("pinhole", {}, None),
    "antialiased": ("pinhole", {"antialiased": True}, None),
    "fisheye": ("fisheye", {}, None),
    "ortho": ("ortho", {}, None),
    "depth": ("pinhole", {}, "accumulated"),
    "expected depth": ("pinhole", {}, "expected"),
    "xray, cone": ("pinhole", {"mode": "xray"}, None),
    "xray, parallel": ("ortho", {"mode": "xray"}, None),
}


@pytest.mark.parametrize("way", WAYS)
def test_every_gradient_is_autograds(device, way):
    model, changes, depth = WAYS[way]
    settings = SplatSettings(smooth_cutoff=True, **changes)
    values, (views, Ks) = scene(40), cameras(model)
    behind = np.float32([[0.1, 0.4, 0.8], [0.9, 0.2, 0.3]])
    expected, leaves = oracle(values, views, Ks, model, settings, depth=depth, behind=behind)
    ours = tensors_of(values, grad=True)
    given = {"viewmats": views, "Ks": Ks}
    given |= {"backgrounds": behind} if settings.mode == "light" else {}
    given = {name: torch.tensor(value, requires_grad=True) for name, value in given.items()}
    images, alphas = render(
        ours, given["viewmats"], given["Ks"], backgrounds=given.get("backgrounds"), depth=depth,
        model=model, settings=settings, device=device,
    )  # fmt: skip
    grad = np.random.default_rng(3).normal(size=images.shape)
    told = np.ones(images.shape)
    if depth == "expected":
        # A quotient of two small numbers where next to nothing is seen, as only smooth cut-offs do.
        told[..., -1] = alphas[..., 0].detach().numpy() > 1 / 255
    grad *= told
    shown = images.detach().numpy() * told
    assert relative(shown, expected.detach().numpy() * told) < 1e-4
    images.backward(torch.tensor(np.float32(grad)))
    expected.backward(torch.tensor(grad))
    for name, tensor in {**ours, **given}.items():
        wanted = leaves[name].grad
        if name == "viewmats":
            wanted = wanted.clone()
            assert not tensor.grad[:, 3].any()
            wanted[:, 3] = 0
        assert relative(tensor.grad.numpy(), wanted.numpy()) < 2e-4, name


def test_covariances_and_features_get_gradients(device):
    """Against the quaternions' way to the same image, by the chain rule in torch."""
    import twin_projection as twin

    values, (views, Ks) = scene(50), map(torch.tensor, cameras())
    views, Ks = views.float(), Ks.float()
    settings = SplatSettings(smooth_cutoff=True)
    colors = np.random.default_rng(5).uniform(0, 1, (50, 5)).astype(np.float32)
    grad = torch.tensor(np.random.default_rng(3).normal(size=(2, *SIZE, 5)), dtype=torch.float32)
    found = []
    for whole in (False, True):
        leaves = tensors_of({n: values[n] for n in NAMES} | {"colors": colors}, grad=True)
        given = dict(leaves)
        if whole:
            full = twin.covariance(leaves["quats"].double(), leaves["scales"].double())
            rows, columns = torch.triu_indices(3, 3)
            given["covars"] = full[:, rows, columns].float()
            del given["quats"], given["scales"]
        images, _ = render(given, views, Ks, settings=settings, device=device)
        images.backward(grad)
        found.append({name: leaf.grad.numpy() for name, leaf in leaves.items()})
    for name, first in found[0].items():
        assert np.linalg.norm(first) > 0
        assert relative(found[1][name], first) < 1e-3, name


def test_positions_on_the_screen_can_be_differentiated_by(device):
    """A loss of the projection alone needs no drawing."""
    values, (views, Ks) = scene(30), map(torch.tensor, cameras())
    leaves = tensors_of(values, grad=True)
    how = interop.drawer(SIZE, device=device)
    screens = interop.project(how, *(leaves[n] for n in NAMES), views, Ks)
    seen = screens.culled == 0
    (screens.means2d[seen].sum() + screens.depths[seen].sum()).backward()
    assert leaves["means"].grad.abs().sum() > 0
    assert not leaves["quats"].grad.any() and not leaves["opacities"].grad.any()


def test_strided_tensors_are_drawn_alike(device):
    values, (views, Ks) = scene(), map(torch.tensor, cameras())
    plain, _ = render(tensors_of(values), views, Ks, device=device)
    strided = {n: torch.tensor(np.asfortranarray(v)) for n, v in values.items()}
    strided["means"] = torch.tensor(np.repeat(values["means"], 2, 0))[::2]
    assert not strided["means"].is_contiguous()
    again, _ = render(
        strided, views.transpose(1, 2).contiguous().transpose(1, 2), Ks, device=device
    )
    assert torch.equal(plain, again)


def test_two_runs_give_the_same_bits(device):
    values, grad = scene(200), None
    runs = []
    for _ in range(2):
        views, Ks = (torch.tensor(a, requires_grad=True) for a in cameras())
        leaves = tensors_of(values, grad=True)
        images, _ = render(leaves, views, Ks, device=device)
        grad = torch.linspace(-1, 1, images.numel()).reshape(images.shape)
        images.backward(grad)
        runs.append([images.detach(), views.grad, Ks.grad, *(t.grad for t in leaves.values())])
    assert all(torch.equal(a, b) for a, b in zip(*runs, strict=True))


def test_no_splats_and_one_pixel(device):
    values = {name: value[:0] for name, value in scene(2).items()}
    views, Ks = map(torch.tensor, cameras())
    leaves = tensors_of(values, grad=True)
    images, alphas = render(leaves, views, Ks, size=(1, 1), device=device)
    assert images.shape == (2, 1, 1, 3) and not alphas.any()
    images.sum().backward()
    assert leaves["means"].grad.shape == (0, 3)


@pytest.mark.parametrize("power", [1, 2])
def test_a_gradient_has_no_derivative_whatever_the_loss(device, power):
    tensors, (views, Ks) = tensors_of(scene(), grad=True), map(torch.tensor, cameras())
    images, _ = render(tensors, views, Ks, device=device)
    loss = (images**power).sum()
    plain = torch.autograd.grad(loss, list(tensors.values()), retain_graph=True)
    found = torch.autograd.grad(loss, list(tensors.values()), create_graph=True)
    assert all(map(torch.equal, plain, found))
    for gradient in found:
        with pytest.raises(InputError, match="differentiated again"):
            (loss + (gradient**2).sum()).backward(retain_graph=True)


def test_a_transform_of_torch_func_is_told_what_to_take(device):
    tensors, (views, Ks) = tensors_of(scene()), map(torch.tensor, cameras())

    def loss(means):
        return render(tensors | {"means": means}, views, Ks, device=device)[0].sum()

    for transform in (torch.func.grad, torch.func.jacrev, torch.vmap):
        with pytest.raises(InputError, match=r"torch\.func.*backward"):
            transform(loss)(tensors["means"][None] if transform is torch.vmap else tensors["means"])
