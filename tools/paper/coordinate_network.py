"""A coordinate network that is a slice: two hidden layers of ReLU on random Fourier features."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
_RATE = 1e-3


def torch_is_missing() -> bool:
    """Whether networks cannot be trained here."""
    return find_spec("torch") is None


class NetworkFit:
    """A network that maps places to densities, trained by Adam on gradients by the slice.

    Args:
        pixels: along the slice's side.
        width: of the hidden layers, and the number of frequencies of the features.
        sigma: standard deviation of these frequencies, in half cycles over half the slice; 0 to
            give the network the coordinates themselves.
        seed: of the features and the weights.
    """

    def __init__(self, pixels: int, width: int, sigma: float, seed: int) -> None:
        import torch

        self._torch = torch
        torch.manual_seed(seed)
        y, x = np.mgrid[:pixels, :pixels] - (pixels - 1) / 2
        places = torch.tensor(np.stack([x, y], -1).reshape(-1, 2) / (pixels / 2)).float()
        self._features: Any = places
        if sigma:
            waves = math.pi * places @ (torch.randn(2, width) * sigma)
            self._features = torch.cat([torch.cos(waves), torch.sin(waves)], dim=1)
        layer, relu = torch.nn.Linear, torch.nn.ReLU
        self._network = torch.nn.Sequential(
            *(layer(self._features.shape[1], width), relu()),
            *(layer(width, width), relu(), layer(width, 1)),
        )
        self._pixels = pixels

    def images(self, gradient: Callable[[Image], Image], truth: Image) -> Iterator[Image]:
        """The slice after each step.

        The gradient is scaled to the norm of the error: Adam's steps are then alike under all
        supervisions, and what differs is their direction.

        Args:
            gradient: of what is minimised, by the slice.
            truth: the slice that is sought, for that scale alone.
        """
        torch = self._torch
        adam = torch.optim.Adam(self._network.parameters(), lr=_RATE)
        first = True
        while True:
            drawn = self._network(self._features).reshape(self._pixels, self._pixels)
            image = drawn.detach().numpy()
            if not first:
                yield image
            first = False
            slope = gradient(image)
            scale = np.linalg.norm(image - truth) / max(float(np.linalg.norm(slope)), 1e-30)
            adam.zero_grad()
            drawn.backward(torch.tensor(slope * np.float32(scale)))
            adam.step()
