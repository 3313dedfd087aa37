"""LPIPS against its definition in NumPy, with weights by chance, and files that hold no weights."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError

torch = pytest.importorskip("torch")
from rift_cl.interop.lpips import Lpips, weight_shapes  # noqa: E402

# Of AlexNet: stride and border of each convolution, and before which features are pooled.
_STRIDES, _BORDERS, _POOLED = (4, 1, 1, 1, 1), (2, 2, 1, 1, 1), (1, 2)


def weights(network="alex"):
    random = np.random.default_rng(4)
    return {
        name: np.abs(random.standard_normal(shape)).astype(np.float32)
        if name.startswith("lin")
        else (random.standard_normal(shape) / np.sqrt(np.prod(shape[1:]))).astype(np.float32)
        for name, shape in weight_shapes(network)
    }


def saved(path, arrays):
    torch.save({name: torch.from_numpy(array) for name, array in arrays.items()}, path)
    return path


def windows(features, side, stride):
    """(channels, rows, columns, side, side) of (channels, rows, columns)."""
    found = np.lib.stride_tricks.sliding_window_view(features, (side, side), axis=(1, 2))
    return found[:, ::stride, ::stride]


def layers(image, arrays):
    """AlexNet's features of a picture, layer by layer, in double precision."""
    shift, spread = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])
    features = np.moveaxis((2 * image.astype(float) - 1 - shift) / spread, 2, 0)
    for layer, number in enumerate((0, 3, 6, 8, 10)):
        if layer in _POOLED:
            features = windows(features, 3, 2).max(axis=(3, 4))
        kernel = arrays[f"net.slice{layer + 1}.{number}.weight"].astype(float)
        border = _BORDERS[layer]
        padded = np.pad(features, ((0, 0), (border, border), (border, border)))
        seen = windows(padded, kernel.shape[2], _STRIDES[layer])
        bias = arrays[f"net.slice{layer + 1}.{number}.bias"][:, None, None]
        features = np.maximum(np.einsum("oihw,iyxhw->oyx", kernel, seen, optimize=True) + bias, 0)
        yield features


def test_lpips_is_its_definition(tmp_path):
    arrays, random = weights(), np.random.default_rng(6)
    image, truth = random.random((2, 35, 40, 3), np.float32)
    wanted = 0.0
    for layer, pair in enumerate(zip(layers(image, arrays), layers(truth, arrays), strict=True)):
        units = [f / (np.sqrt((f**2).sum(axis=0)) + 1e-10) for f in pair]
        weight = arrays[f"lin{layer}.model.1.weight"][0, :, 0, 0]
        wanted += np.mean(np.tensordot(weight, (units[0] - units[1]) ** 2, 1))
    score = Lpips(saved(tmp_path / "alex.pth", arrays))
    assert score(image, truth) == pytest.approx(wanted, rel=1e-4)
    assert score(image, image) == 0
    with pytest.raises(ShapeError, match="32 pixels"):
        score(image[:20], truth[:20])


@pytest.mark.full
def test_vgg_is_told_by_its_weights(tmp_path):
    score = Lpips(saved(tmp_path / "vgg.pth", weights("vgg")))
    assert score.network == "vgg"
    image, truth = np.random.default_rng(6).random((2, 32, 32, 3), np.float32)
    assert score(image, truth) > 0 and score(image, image) == 0


def test_lpips_agrees_with_the_package_of_its_authors(tmp_path):
    lpips = pytest.importorskip("lpips")
    theirs = lpips.LPIPS(net="alex", pretrained=True, pnet_rand=True, verbose=False)
    torch.save(theirs.state_dict(), tmp_path / "alex.pth")
    pair = np.random.default_rng(6).random((2, 40, 35, 3), np.float32)
    tensors = [torch.from_numpy(image).permute(2, 0, 1)[None] * 2 - 1 for image in pair]
    with torch.no_grad():
        wanted = float(theirs(*tensors))
    assert Lpips(tmp_path / "alex.pth")(*pair) == pytest.approx(wanted, rel=1e-4)


def test_a_file_without_weights_is_named(tmp_path):
    arrays = weights()
    arrays["net.slice3.6.weight"] = arrays["net.slice3.6.weight"][:5]
    (tmp_path / "text.pth").write_text("no weights")
    torch.save([1], tmp_path / "list.pth")
    saved(tmp_path / "cut.pth", arrays)
    names = {"text": "text.pth", "list": "list.pth", "cut": "slice3", "nowhere": "nowhere.pth"}
    for name, words in names.items():
        with pytest.raises(InputError, match=words):
            Lpips(tmp_path / f"{name}.pth")


def test_code_in_a_file_is_not_run(tmp_path):
    class Harmful:
        def __reduce__(self):
            return (tmp_path.joinpath("ran").write_text, ("x",))

    torch.save({"net.slice1.0.weight": Harmful()}, tmp_path / "bad.pth")
    with pytest.raises(InputError, match=r"bad\.pth"):
        Lpips(tmp_path / "bad.pth")
    assert not (tmp_path / "ran").exists()
