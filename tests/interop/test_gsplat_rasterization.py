"""gsplat's ``rasterization``: its shapes, conventions and ``meta``, on the same kernels."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from projection_scenes import camera_of, random_splats

import rift_cl as rift
from rift_cl.reference.splat_projection import spherical_harmonics
from rift_cl.splat.settings import SplatSettings

torch = pytest.importorskip("torch", reason="torch is not installed")
from rift_cl.interop import torch as interop  # noqa: E402 - it needs torch
from rift_cl.interop.gsplat import rasterization  # noqa: E402

pytestmark = pytest.mark.once

HEIGHT, WIDTH, COUNT, CAMERAS = 45, 61, 70, 3
NAMES = ("means", "quats", "scales", "opacities")
ROWS = ("means2d", "conics", "depths", "opacities", "radii")


def scene(*, grad=False, batch=(), channels=None):
    """Arguments of ``rasterization`` by name."""
    count = int(np.prod(batch, dtype=int))
    values = random_splats(COUNT * count, coefficients=16, wide=1.2)
    values["colors"] = values.pop("sh")
    if channels:
        random = np.random.default_rng(5)
        values["colors"] = random.uniform(0, 1, (COUNT * count, channels)).astype(np.float32)
    base = camera_of("pinhole", focal=60.0)
    views = np.tile(base.view, (CAMERAS * count, 1, 1))
    views[:, 0, 3] += np.linspace(-0.4, 0.4, CAMERAS * count)
    K = base.K.copy()
    K[:2, 2] = 30.3, 22.7
    shaped = {n: v.reshape(*batch, COUNT, *v.shape[1:]) for n, v in values.items()}
    shaped["viewmats"] = views.reshape(*batch, CAMERAS, 4, 4)
    shaped["Ks"] = np.broadcast_to(K, (*batch, CAMERAS, 3, 3))
    given = {n: torch.tensor(np.float32(v), requires_grad=grad) for n, v in shaped.items()}
    return given | {"width": WIDTH, "height": HEIGHT}


def draw(device, arguments, **options):
    options = {"sh_degree": 3 if np.ndim(arguments["colors"]) > 2 else None} | options
    return rasterization(**arguments, **options, device=device)


def test_colors_of_an_orthographic_camera_are_seen_from_where_it_stands(device):
    """As in gsplat, which takes no account of rays that are parallel there."""
    given = scene()
    harmonics, colors = given["colors"].numpy().astype(float), []
    for view in given["viewmats"].numpy().astype(float):
        center = -np.linalg.solve(view[:3, :3], view[:3, 3])
        basis = spherical_harmonics(given["means"].numpy() - center, 3)
        colors.append(np.maximum(np.einsum("nk,nkc->nc", basis, harmonics) + 0.5, 0))
    plain = given | {"colors": torch.tensor(np.float32(colors))}
    wanted, *_ = draw(device, plain, sh_degree=None, camera_model="ortho")
    found, *_ = draw(device, given, camera_model="ortho")
    assert wanted.std() > 0.01
    np.testing.assert_allclose(found.numpy(), wanted.numpy(), atol=2e-5)


def test_the_image_is_that_of_our_own_api(device):
    given = scene()
    images, alphas, meta = draw(device, given)
    ours, thin = interop.render(
        *(given[name] for name in NAMES), given["viewmats"], given["Ks"], sh=given["colors"],
        size=(HEIGHT, WIDTH), settings=SplatSettings(alpha_cap=0.999), device=device,
    )  # fmt: skip
    assert images.shape == (CAMERAS, HEIGHT, WIDTH, 3)
    assert alphas.shape == (CAMERAS, HEIGHT, WIDTH, 1)
    assert torch.equal(images, ours) and torch.equal(alphas, thin)
    assert (meta["width"], meta["height"], meta["tile_size"]) == (WIDTH, HEIGHT, 16)
    assert (meta["tile_width"], meta["tile_height"]) == (4, 3)
    assert (meta["n_batches"], meta["n_cameras"]) == (1, CAMERAS)


def test_packed_or_not_gives_the_same_bits(device):
    found = []
    for packed in (True, False):
        given = scene(grad=True)
        images, alphas, meta = draw(device, given, packed=packed, absgrad=True)
        meta["means2d"].retain_grad()
        (images.sin().sum() + alphas.cos().sum()).backward()
        leaves = {n: t.grad for n, t in given.items() if isinstance(t, torch.Tensor)}
        seen = meta["means2d"].grad, meta["means2d"].absgrad
        found.append((images.detach(), leaves, seen, meta))
    (image, leaves, seen, meta), (image2, leaves2, seen2, meta2) = found
    assert torch.equal(image, image2)
    for name, grad in leaves.items():
        assert torch.equal(grad, leaves2[name]), name
    ids = meta["camera_ids"], meta["gaussian_ids"]
    for packed, whole in zip(seen, seen2, strict=True):
        assert torch.equal(packed, whole[ids])
    for name in ROWS:
        assert torch.equal(meta[name], meta2[name][ids]), name
        assert meta2[name].shape[:2] == (CAMERAS, COUNT)
    assert meta2["camera_ids"] is None and (meta["batch_ids"] == 0).all()
    assert meta["radii"].dtype == torch.int32 and (meta["radii"] > 0).all()


def test_absgrad_bounds_the_gradient(device):
    given = scene(grad=True)
    images, _, meta = draw(device, given, absgrad=True)
    meta["means2d"].retain_grad()
    images.sin().sum().backward()
    plain, magnitude = meta["means2d"].grad, meta["means2d"].absgrad
    assert magnitude.shape == plain.shape
    assert (magnitude >= plain.abs() * (1 - 1e-3) - 1e-5).all()
    assert (magnitude > 1.5 * plain.abs()).float().mean() > 0.5


def test_batches_are_their_members(device):
    batch = (2, 1)
    given = scene(batch=batch)
    backgrounds = torch.rand(*batch, CAMERAS, 3, generator=torch.Generator().manual_seed(0))
    for packed in (True, False):
        images, alphas, meta = draw(
            device, given, packed=packed, backgrounds=backgrounds, sh_degree=2
        )
        assert images.shape == (*batch, CAMERAS, HEIGHT, WIDTH, 3)
        assert meta["isect_offsets"].shape == (*batch, CAMERAS, 3, 4)
        for number in range(2):
            one = {n: t[number, 0] if isinstance(t, torch.Tensor) else t for n, t in given.items()}
            alone, thin, _ = draw(device, one, backgrounds=backgrounds[number, 0], sh_degree=2)
            assert torch.equal(images[number, 0], alone)
            assert torch.equal(alphas[number, 0], thin)
    assert meta["means2d"].shape == (*batch, CAMERAS, COUNT, 2)
    assert meta["tiles_per_gauss"].shape == (*batch, CAMERAS, COUNT)


@pytest.mark.parametrize("packed", [True, False])
def test_every_camera_may_have_its_own_colours(device, packed):
    given = scene()
    same = given["colors"].expand(CAMERAS, -1, -1, -1)
    first, *_ = draw(device, given, packed=packed)
    second, *_ = draw(device, given | {"colors": same}, packed=packed, sh_degree=3)
    assert torch.equal(first, second)
    plain = scene(channels=5)
    each = torch.stack([plain["colors"] * (k + 1) for k in range(CAMERAS)])
    images, *_ = draw(device, plain | {"colors": each}, packed=packed, sh_degree=None)
    for k in range(CAMERAS):
        one, *_ = draw(device, plain | {"colors": each[k]}, packed=packed)
        assert torch.equal(images[k], one[k])


def test_render_modes(device):
    given, behind = scene(), torch.full((CAMERAS, 3), 0.3)
    images, alphas, _ = draw(device, given, render_mode="RGB+D", backgrounds=behind)
    color, *_ = draw(device, given, backgrounds=behind)
    depth, *_ = draw(device, given, render_mode="D")
    expected, *_ = draw(device, given, render_mode="ED", backgrounds=behind[:, :1])
    both, *_ = draw(device, given, render_mode="RGB+ED", backgrounds=behind)
    assert torch.equal(images[..., :3], color) and torch.equal(images[..., 3:], depth)
    assert torch.equal(both[..., :3], color) and torch.equal(both[..., 3:], expected)
    assert torch.equal(expected, depth / alphas.clamp(min=1e-10))
    seen = alphas[..., 0] > 0.5
    assert seen.any() and ((expected[..., 0] > 1) & (expected[..., 0] < 9))[seen].all()


def test_fewer_harmonics_are_those_of_the_lower_degree(device):
    given = scene()
    used = given | {"colors": given["colors"][:, :4].clone()}
    first, *_ = draw(device, given, sh_degree=1)
    second, *_ = draw(device, used, sh_degree=1)
    assert torch.equal(first, second)


def test_many_channels_are_drawn_in_one_call(device):
    images, *_ = draw(device, scene(channels=40), channel_chunk=8)
    assert images.shape[-1] == 40
    few = scene(channels=40)
    few["colors"] = few["colors"][:, 35:]
    other, *_ = draw(device, few)
    np.testing.assert_allclose(images[..., 35:], other, rtol=1e-5, atol=1e-6)


def test_covariances_come_as_matrices(device):
    import twin_projection as twin

    given = scene()
    covars = twin.covariance(given["quats"].double(), given["scales"].double()).float()
    first, *_ = draw(device, given)
    second, *_ = draw(device, given | {"covars": covars})
    assert (first - second).abs().max() < 5e-3
    assert (first - second).abs().mean() < 1e-5


def test_lists_of_intersections_tell_what_is_drawn(device):
    """The fields from which others rasterize: sorted keys, and rows in range of each tile."""
    for packed in (True, False):
        _, _, meta = draw(device, scene(), packed=packed)
        keys, rows = meta["isect_ids"], meta["flatten_ids"].long()
        assert (keys[1:] >= keys[:-1]).all()
        depths = meta["depths"].flatten()
        bits = depths[rows].contiguous().view(torch.int32).long() & 0xFFFFFFFF
        assert torch.equal(keys & 0xFFFFFFFF, bits)
        assert int(meta["tiles_per_gauss"].sum()) == len(keys)
        offsets = meta["isect_offsets"].flatten()
        tile = (keys >> 32) & 0xF
        image = keys >> 36
        number = torch.searchsorted(offsets, torch.arange(len(keys)).int(), right=True) - 1
        counts = torch.diff(offsets, append=offsets.new_tensor([len(keys)]))
        filled = torch.repeat_interleave(torch.arange(len(offsets)), counts)
        assert torch.equal(filled, image * 12 + tile) and len(number) == len(filled)


def test_gsplat_lists_the_same_tiles(device):
    gsplat = pytest.importorskip("gsplat.cuda._torch_impl", reason="gsplat is not installed")
    _, _, meta = draw(device, scene(), packed=False)
    lists = gsplat._isect_tiles(meta["means2d"], meta["radii"], meta["depths"], 16, 4, 3)
    for ours, theirs in zip(("tiles_per_gauss", "isect_ids", "flatten_ids"), lists, strict=True):
        assert torch.equal(meta[ours].long(), theirs.long()), ours
    offsets = gsplat._isect_offset_encode(lists[1], CAMERAS, 4, 3)
    assert torch.equal(meta["isect_offsets"], offsets)


def test_the_signature_is_gsplats():
    """Read from its source: the package cannot be imported everywhere."""
    import ast
    from importlib.util import find_spec
    from pathlib import Path

    spec = find_spec("gsplat")
    if spec is None or spec.origin is None:
        pytest.skip("gsplat is not installed")
    tree = ast.parse(Path(spec.origin).with_name("rendering.py").read_text())
    theirs = next(n for n in tree.body if getattr(n, "name", "") == "rasterization")
    ours = inspect.signature(rasterization).parameters
    positional = [p.name for p in ours.values() if p.kind is not p.KEYWORD_ONLY]
    assert positional == [argument.arg for argument in theirs.args.args]
    defaults = [ast.unparse(value) for value in theirs.args.defaults]
    mine = [repr(ours[name].default) for name in positional[-len(defaults) :]]
    same = [a == b or "RollingShutter" in b for a, b in zip(mine, defaults, strict=True)]
    assert all(same), (mine, defaults)


def test_bands_change_no_bit(device):
    whole, _, meta = draw(device, scene())
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=170_000)
    banded, _, lists = draw(small, scene())
    assert torch.equal(whole, banded)
    assert torch.equal(meta["isect_ids"], lists["isect_ids"])


def covariances_of(quats, scales):
    """R S S' R' as gsplat multiplies it, by torch alone."""
    w, x, y, z = torch.nn.functional.normalize(quats, dim=-1).unbind(-1)
    rows = (
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    spread = torch.stack(rows, -1).reshape(-1, 3, 3) * scales[:, None, :]
    return spread @ spread.transpose(1, 2)


def test_the_sign_of_a_scale_says_nothing_and_0_is_flat_as_in_products_of_scales(device):
    found = []
    for given_as in ("scales", "covariances"):
        given = scene(grad=True)
        with torch.no_grad():
            given["scales"][::3, 1] *= -1
            given["scales"][1::3, 2] = 0
        leaves = quats, scales = given["quats"], given["scales"]
        # A covariance that is flat to the last bit may be none after rounding: nearly flat is.
        spread = torch.where(scales == 0, 1e-5, scales)
        covars = covariances_of(quats, spread) if given_as == "covariances" else None
        images, _, meta = draw(device, given, covars=covars)
        images.sin().sum().backward()
        found.append((images.detach(), *(leaf.grad for leaf in leaves)))
        seen = set(meta["gaussian_ids"].tolist())
        assert seen & {*range(0, COUNT, 3)} and seen & {*range(1, COUNT, 3)}
    for ours, wanted in zip(*found, strict=True):
        assert wanted.abs().max() > 0
        assert (ours - wanted).abs().max() < 1e-3 * wanted.abs().max()
    # What changes a flat one at second order alone has no gradient.
    assert (found[0][2][1::3, 2] == 0).all()
    points = scene()
    points["scales"] = torch.zeros_like(points["scales"])
    assert draw(device, points)[1].max() > 0.1
