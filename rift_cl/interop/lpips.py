"""LPIPS: distance of two pictures in the features of a network that was trained on photographs.

Zhang et al., CVPR 2018, with AlexNet or VGG16 below it, in torch alone. The weights are the user's:
they are not ours to pass on, and nothing is fetched from the network. Whoever has the package
``lpips`` writes them once:

    torch.save(lpips.LPIPS(net="alex").state_dict(), "alex.pth")
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from rift_cl.errors import InputError, ShapeError

_Image = NDArray[np.float32]

# VGG16 takes 59 MB.
_MOST_BYTES = 1 << 28
# Pixels along the shorter side that AlexNet's last features need.
_LEAST = 32
# Mean and spread of the photographs that the networks were trained on, for colours from -1 to 1.
_SHIFT, _SPREAD = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
_TINY = 1e-10


class _Convolution(NamedTuple):
    """One of a network: its number there, channels it makes, side of its kernel, stride, border."""

    number: int
    channels: int
    side: int = 3
    stride: int = 1
    border: int = 1


class _Network(NamedTuple):
    """Convolutions of each layer, and over how many pixels features are pooled before which."""

    layers: tuple[tuple[_Convolution, ...], ...]
    pooled: tuple[int, ...]
    pool: int


def _vgg_layer(first: int, count: int, channels: int) -> tuple[_Convolution, ...]:
    return tuple(_Convolution(first + 2 * k, channels) for k in range(count))


_NETWORKS = {
    "alex": _Network(
        layers=(
            (_Convolution(0, 64, 11, 4, 2),),
            (_Convolution(3, 192, 5, 1, 2),),
            (_Convolution(6, 384),),
            (_Convolution(8, 256),),
            (_Convolution(10, 256),),
        ),
        pooled=(1, 2),
        pool=3,
    ),
    "vgg": _Network(
        layers=(
            _vgg_layer(0, 2, 64),
            _vgg_layer(5, 2, 128),
            _vgg_layer(10, 3, 256),
            _vgg_layer(17, 3, 512),
            _vgg_layer(24, 3, 512),
        ),
        pooled=(1, 2, 3, 4),
        pool=2,
    ),
}


class Lpips:
    """LPIPS with weights from a file; called with two pictures, it returns their distance.

    Args:
        path: a state dictionary of ``lpips.LPIPS`` (version 0.1, net "alex" or "vgg"), as
            ``torch.save`` writes it. It is read with ``weights_only``: no code in it is run.

    Raises:
        InputError: the file cannot be read, or holds something else.
    """

    def __init__(self, path: Path) -> None:
        found = _read(path)
        self.network = "vgg" if "net.slice1.2.weight" in found else "alex"
        self._weights = {
            name: _array(path, found, name, shape) for name, shape in weight_shapes(self.network)
        }

    def __call__(self, image: _Image, truth: _Image) -> float:
        """The distance of a picture from the truth, 0 for equal ones.

        Args:
            image: (height, width, 3) in display light from 0 to 1.
            truth: of the same shape.

        Raises:
            ShapeError: the shapes differ, or a picture is too small for the network.
        """
        if image.shape != truth.shape or image.shape[2:] != (3,) or min(image.shape[:2]) < _LEAST:
            raise ShapeError(
                f"LPIPS: image has shape {image.shape} and truth {truth.shape}, wanted (height, "
                f"width, 3) twice, {_LEAST} pixels or more along each side"
            )
        pair = torch.from_numpy(np.stack([image, truth]).astype(np.float32)).permute(0, 3, 1, 2)
        shift, spread = (torch.tensor(values)[:, None, None] for values in (_SHIFT, _SPREAD))
        features, total = (2 * pair - 1 - shift) / spread, 0.0
        with torch.no_grad():
            for layer in range(len(_NETWORKS[self.network].layers)):
                features = self._deeper(features, layer)
                unit = features / (features.square().sum(dim=1, keepdim=True).sqrt() + _TINY)
                weight = self._weights[f"lin{layer}.model.1.weight"]
                total += float(functional.conv2d((unit[:1] - unit[1:]).square(), weight).mean())
        return total

    def _deeper(self, features: torch.Tensor, layer: int) -> torch.Tensor:
        """The features of a layer from those of the layer before."""
        network = _NETWORKS[self.network]
        if layer in network.pooled:
            features = functional.max_pool2d(features, network.pool, stride=2)
        for convolution in network.layers[layer]:
            name = f"net.slice{layer + 1}.{convolution.number}"
            features = functional.conv2d(
                features,
                self._weights[f"{name}.weight"],
                self._weights[f"{name}.bias"],
                stride=convolution.stride,
                padding=convolution.border,
            ).relu()
        return features


def weight_shapes(network: str) -> list[tuple[str, tuple[int, ...]]]:
    """Names and shapes of the arrays that LPIPS reads of a state dictionary.

    Args:
        network: "alex" or "vgg".
    """
    shapes: list[tuple[str, tuple[int, ...]]] = []
    channels = 3
    for layer, convolutions in enumerate(_NETWORKS[network].layers):
        for number, made, side, *_ in convolutions:
            name = f"net.slice{layer + 1}.{number}"
            shapes += [(f"{name}.weight", (made, channels, side, side)), (f"{name}.bias", (made,))]
            channels = made
        shapes.append((f"lin{layer}.model.1.weight", (1, channels, 1, 1)))
    return shapes


def _read(path: Path) -> Mapping[str, Any]:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path} is larger than any weights of LPIPS")
        found = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, KeyError, pickle.UnpicklingError) as error:
        raise InputError(
            f"{path} holds no weights of LPIPS that torch reads safely: {error}"
        ) from error
    if not isinstance(found, Mapping):
        raise InputError(f"{path} holds no state dictionary of LPIPS")
    return found


def _array(path: Path, found: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> torch.Tensor:
    array = found.get(name)
    if not isinstance(array, torch.Tensor) or tuple(array.shape) != shape:
        has = tuple(array.shape) if isinstance(array, torch.Tensor) else "nothing"
        raise InputError(
            f"{path} holds {has} as {name}, wanted {shape}: write it by torch.save of the "
            "state_dict() of lpips.LPIPS with net 'alex' or 'vgg'"
        )
    return array.to(torch.float32)
