"""What cannot be drawn through torch is named, in one sentence, before anything is drawn."""

from __future__ import annotations

import pytest

from rift_cl.errors import DeviceError, DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.splat.settings import SplatSettings

torch = pytest.importorskip("torch", reason="torch is not installed")
from test_torch_render import NAMES, cameras, render, scene, tensors_of  # noqa: E402 - needs torch

pytestmark = pytest.mark.once

BAD = {
    "double": ({"means": lambda t: t.double()}, DTypeError, r"means.*float64.*call"),
    "whole numbers": ({"opacities": lambda t: t.int()}, DTypeError, "opacities.*int32"),
    "array": ({"scales": lambda t: t.numpy()}, DTypeError, "scales is a ndarray"),
    "sparse": ({"means": lambda t: t.to_sparse()}, DTypeError, "means.*sparse"),
    "shape": ({"quats": lambda t: t[:, :3]}, ShapeError, r"quats has shape \(60, 3\), wanted"),
    "count": ({"opacities": lambda t: t[:-1]}, ShapeError, r"opacities has shape \(59,\)"),
    "harmonics": ({"sh": lambda t: t[:, :5]}, ShapeError, "5 coefficients"),
    "elsewhere": ({"scales": lambda t: t.to("meta")}, DeviceError, "scales is on the meta device"),
    "views": ({"views": lambda t: t[0]}, ShapeError, "viewmats has shape"),
    "no views": ({"views": lambda t: t[:0], "Ks": lambda t: t[:0]}, ShapeError, "one view or more"),
    "pose": ({"views": lambda t: t * float("nan")}, NonFiniteError, "view"),
    "mirror": ({"views": lambda t: -t}, InputError, "view"),
    "singular": ({"Ks": lambda t: 0 * t}, InputError, "focal lengths"),
    "logarithms": ({"scales": lambda t: t.log()}, InputError, r"scales go down to.*exp"),
    "negative": ({"scales": lambda t: -t}, InputError, r"scales go down to.*exp"),
    "logits": ({"opacities": lambda t: t.logit()}, InputError, r"opacities go from.*sigmoid"),
    "above 1": ({"opacities": lambda t: t + 1}, InputError, r"opacities go from.*sigmoid"),
    "NaN": ({"means": lambda t: t * float("nan")}, NonFiniteError, "means holds NaN"),
    "infinity": ({"sh": lambda t: t / 0}, NonFiniteError, "sh holds NaN or infinity"),
    "lenses": ({"Ks": lambda t: t[:1]}, ShapeError, r"Ks has shape \(1, 3, 3\)"),
}


SIZES = (20, 30), (20.0, 30.0), torch.tensor([20, 30])


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_drawn_is_named(device, case):
    changes, error, words = BAD[case]
    tensors = tensors_of(scene()) | dict(
        zip(("views", "Ks"), map(torch.tensor, cameras()), strict=True)
    )
    tensors |= {name: change(tensors[name]) for name, change in changes.items()}
    views, Ks = tensors.pop("views"), tensors.pop("Ks")
    with pytest.raises(error, match=words):
        render(tensors, views, Ks, device=device)


def test_options_that_do_not_fit_are_named(device):
    tensors, (views, Ks) = tensors_of(scene()), map(torch.tensor, cameras())
    with pytest.raises(InputError, match="depth is 'far'"):
        render(tensors, views, Ks, depth="far", device=device)
    with pytest.raises(InputError, match="xray"):
        render(
            tensors, views, Ks, depth="expected", settings=SplatSettings(mode="xray"), device=device
        )
    with pytest.raises(InputError, match="nothing is drawn"):
        render({n: tensors[n] for n in NAMES}, views, Ks, device=device)
    with pytest.raises(InputError, match="quats and scales"):
        render(tensors | {"covars": torch.zeros(60, 6)}, views, Ks, device=device)
    with pytest.raises(ShapeError, match="backgrounds"):
        render(tensors, views, Ks, backgrounds=torch.zeros(2, 4), device=device)
    for size in ((0, 5), (20.5, 30), (20, 30, 1), 20, ("tall", "wide")):
        with pytest.raises(ShapeError, match="size"):
            render(tensors, views, Ks, size=size, device=device)


def test_whole_numbers_of_any_type_are_a_size(device):
    tensors, (views, Ks) = tensors_of(scene()), map(torch.tensor, cameras())
    images = [render(tensors, views, Ks, size=size, device=device)[0] for size in SIZES]
    assert all(torch.equal(image, images[0]) for image in images[1:])


def test_what_has_no_meaning_in_xray_mode_is_refused(device):
    tensors, (views, Ks) = tensors_of(scene()), map(torch.tensor, cameras())
    given = {"settings": SplatSettings(mode="xray"), "device": device}
    with pytest.raises(InputError, match=r"backgrounds.*xray"):
        render(tensors, views, Ks, backgrounds=torch.zeros(2, 3), **given)
    with pytest.raises(InputError, match=r"densities in xray mode, go down to -0\.5"):
        render(tensors | {"opacities": tensors["opacities"] * 0 - 0.5}, views, Ks, **given)


@pytest.mark.parametrize(
    "settings", [SplatSettings(mode="xray"), SplatSettings(activation="exp"), SplatSettings()]
)
def test_opacities_that_are_densities_or_depths_may_be_above_1(device, settings):
    tensors, (views, Ks) = tensors_of(scene()), map(torch.tensor, cameras())
    free = settings != SplatSettings()
    tensors["opacities"] = tensors["opacities"] * 0 + (3 if free else 1)
    images, _ = render(tensors, views, Ks, settings=settings, device=device)
    assert images.abs().max() > 0
