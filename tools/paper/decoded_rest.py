"""Splats whose own colours leave a rest, which one small network decodes for all of them.

The hybrid of splats and a radiance field that the paper "RiFT" names as future work, in torch and
as small as it can be: features of a splat's place from a hash grid (Mueller et al. 2022) and its
viewing direction go through one hidden layer to three numbers, which are added to what its lobes
show. The network begins at nothing, so that the fit begins as one without it. Rasterizer, loss,
strategy and the splats' own step of Adam are the package's; colours of the network are drawn as
channels of their own, whose gradient goes back through torch.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from paper.small_field import FieldSize, HashGrid, second_degree
from rift_cl import Device
from rift_cl.cl.arithmetic import axpby, copy_columns
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.geometry import Camera
from rift_cl.train import Trainer

Floats = NDArray[np.float32]
_WIDTH, _COLORS = 64, 3


class RestNetwork(torch.nn.Module):
    """What is added to the colours of splats, by their places and viewing directions.

    Args:
        size: of the hash grid.
        box: (3,) and (3,), two opposite corners of where the splats are.
    """

    def __init__(self, size: FieldSize, box: tuple[Floats, Floats]) -> None:
        super().__init__()
        self.encoding = HashGrid(size)
        self.hidden = torch.nn.Linear(self.encoding.width + 9, _WIDTH)
        self.last = torch.nn.Linear(_WIDTH, _COLORS)
        torch.nn.init.zeros_(self.last.weight)
        torch.nn.init.zeros_(self.last.bias)
        self.low, self.high = (torch.tensor(np.asarray(end, np.float32)) for end in box)

    def forward(self, places: Any, center: Any) -> Any:
        """(n, 3) of places (n, 3) as seen from a camera's centre (3,)."""
        features = self.encoding((places - self.low) / (self.high - self.low))
        ways = torch.nn.functional.normalize(places - center, dim=1)
        return self.last(torch.relu(self.hidden(torch.cat([features, second_degree(ways)], dim=1))))


class RestPictures(CapturePictures):
    """Photographs of a fit that draws the rest in three further channels."""

    def background(self, number: int) -> Any:
        """What is behind the splats, and nothing behind the rest."""
        return with_rest(self.device, self.device.get(super().background(number)))


def with_rest(device: Device, behind: Floats) -> Any:
    """A background for images with the rest's channels."""
    return device.array(np.pad(behind, (0, _COLORS)))


class DecodedTrainer(Trainer):
    """A fit of splats and of the network, from the first step on.

    Args:
        begun: a fit before its first step, which this one takes the place of.
        network: what is added.
        rate: of Adam, for the network; it falls as those of colours do.
    """

    def __init__(self, begun: Trainer, network: RestNetwork, *, rate: float = 5e-3) -> None:
        pictures: Any = begun.pictures
        super().__init__(
            RestPictures(
                begun.device, pictures.views, seed=begun.settings.seed, like=begun.pictures
            ),
            begun.parameters,
            begun.settings,
            begun.renderer.settings,
        )
        self.network, self._rate = network, rate
        self._adam = torch.optim.Adam(network.parameters(), lr=rate, eps=1e-15)
        self._rest = self._by_rest = torch.zeros(0)
        self._note_gradients()

    def _note_gradients(self) -> None:
        """Keep the gradient by the splats' ``colors``, which nothing but strategies is shown."""
        after = self.strategy.after_step

        def noted(parameters: Any, frame: Any, gradients: Any, rate: float) -> Any:
            self._by_rest = torch.from_numpy(self.device.get(gradients.colors))
            return after(parameters, frame, gradients, rate)

        self.strategy.after_step = noted  # type: ignore[method-assign]

    def _before_step(self) -> None:
        camera = self.camera(self.view_at(self.parameters.step))
        self._rest = self._decoded(camera)
        colors = self.device.array(self._rest.detach().numpy())
        self.parameters.drawn = replace(self.parameters.drawn, colors=colors)

    def _decoded(self, camera: Camera) -> Any:
        means = torch.from_numpy(self.device.get(self.parameters.raw["means"]))
        return self.network(means, torch.tensor(camera.center, dtype=torch.float32))

    def _compared(self, frame: Any, number: int) -> Any:
        """The loss of the sum of both kinds of channels, which have the same gradient."""
        add_rest(self.device, frame.image)
        value, by_image = super()._compared(frame, number)
        by = by_image.reshape((-1, 2 * _COLORS))
        copy_columns(self.device, by, 0, by, _COLORS, _COLORS)
        return value, by_image

    def _after_step(self) -> None:
        step = self.parameters.step - 1
        fade = self.schedule.learning_rates(step)["sh"] / self.settings.learning_rates.sh
        self._adam.param_groups[0]["lr"] = fade * self._rate
        self._adam.zero_grad()
        self._rest.backward(self._by_rest)
        self._adam.step()

    def picture(self, camera: Camera) -> Floats:
        """(height, width, 3) of a camera."""
        with torch.no_grad():
            colors = self.device.array(self._decoded(camera).numpy())
        splats = replace(self.parameters.drawn, colors=colors)
        pictures: Any = self.pictures
        behind = with_rest(self.device, pictures.behind)
        image = self.renderer.forward(splats, camera, background=behind).image
        add_rest(self.device, image)
        return np.ascontiguousarray(self.device.get(image)[..., :_COLORS])


def add_rest(device: Device, image: Any) -> None:
    """Add the rest's channels of an image (height, width, 6) to the first three, in place."""
    table = image.reshape((-1, 2 * _COLORS))
    own, rest = (device.empty((table.shape[0], _COLORS)) for _ in range(2))
    copy_columns(device, table, 0, own, 0, _COLORS)
    copy_columns(device, table, _COLORS, rest, 0, _COLORS)
    axpby(device, 1.0, rest, 1.0, own)
    copy_columns(device, own, 0, table, 0, _COLORS)
