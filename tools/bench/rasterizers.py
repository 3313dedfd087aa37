"""Who draws splats in the race: our renderer, gsplat on CUDA, and tiles in plain torch.

Both start from parameters where they keep them and leave image and gradients there. The gradient
is that of the sum of the image times white noise, by every parameter of the splats and by the
background.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Floats
from bench.contender import Contender, LeftOutError, relative
from bench.splats import SplatCase
from rift_cl.splat import Renderer


class Rasterizer(Contender):
    """Rendering, and rendering with the gradient."""

    case: SplatCase
    operations = ("draw", "draw and gradient")

    @abstractmethod
    def draw(self) -> Any:
        """The image."""

    @abstractmethod
    def draw_and_gradient(self) -> Any:
        """Draw, differentiate by everything, and give the gradient by the means."""

    def prepared(self, operation: str) -> Callable[[], Any]:
        """One of the two; the scene is in place already."""
        return {"draw": self.draw, "draw and gradient": self.draw_and_gradient}[operation]

    def accuracy(self, outputs: Mapping[str, Floats], *, seed: int) -> dict[str, float | None]:
        """Relative L2 distance from what we make of it: of images, and of gradients by means."""
        case = self.case
        exact = {"draw": case.frame.image, "draw and gradient": case.gradients.splats.means}
        return {name: relative(outputs[name], case.device.get(exact[name])) for name in exact}


class RiftRasterizer(Rasterizer):
    """Ours, arrays on the device in and out."""

    name = "rift_cl, device"
    arrays = "device"
    ours = True
    repeats = 3

    def __init__(self, device: rift.Device, case: SplatCase) -> None:
        super().__init__(device, case)
        self._renderer = Renderer(device=device)
        self._background = device.array(case.background)
        self._grad_image = device.array(case.grad_image)

    def leave(self, array: Any) -> Floats:
        """Copy to the host."""
        found: Floats = self.device.get(array)
        return found

    def draw(self) -> Any:
        """Draw and wait for the image."""
        image = self._frame().image
        self.device.finish()
        return image

    def draw_and_gradient(self) -> Any:
        """Draw, differentiate and wait for the gradients."""
        gradients = self._renderer.backward(self._frame(), self._grad_image)
        self.device.finish()
        return gradients.splats.means

    def _frame(self) -> Any:
        case = self.case
        return self._renderer.forward(case.splats, case.camera, background=self._background)


class Gsplat(Rasterizer):
    """gsplat's CUDA kernels, tensors on the GPU in and out."""

    name = "gsplat, CUDA"
    arrays = "torch"
    place = "GPU"
    repeats = 3

    def __init__(self, device: rift.Device, case: SplatCase) -> None:
        super().__init__(device, case)
        self._torch = torch = import_module("torch")
        if not torch.cuda.is_available():
            raise LeftOutError("torch finds no CUDA device")
        self._rasterization = import_module("gsplat").rasterization

        def leaf(array: Any) -> Any:
            return torch.tensor(np.float32(array), device="cuda", requires_grad=True)

        self._parameters = {name: leaf(array) for name, array in case.parameters.items()}
        self._background = leaf(case.background)
        with torch.no_grad():
            self._grad_image = leaf(case.grad_image).detach()
            self._view = leaf(case.camera.view).detach()[None]
            self._K = leaf(case.camera.K).detach()[None]

    def leave(self, array: Any) -> Floats:
        """Copy to the host."""
        found: Floats = array.detach().cpu().numpy()
        return found

    def draw(self) -> Any:
        """Draw and wait for the image."""
        with self._torch.no_grad():
            image = self._image()
        self._torch.cuda.synchronize()
        return image

    def draw_and_gradient(self) -> Any:
        """Draw, differentiate and wait for the gradients."""
        for leaf in (*self._parameters.values(), self._background):
            leaf.grad = None
        (self._image() * self._grad_image).sum().backward()
        self._torch.cuda.synchronize()
        return self._parameters["means"].grad

    def _image(self) -> Any:
        values = self._parameters
        height, width = self.case.camera.size
        image, _, _ = self._rasterization(
            values["means"],
            values["quats"],
            values["scales"],
            values["opacities"],
            values["sh"],
            self._view,
            self._K,
            width,
            height,
            sh_degree=3,
            packed=False,
            backgrounds=self._background[None],
        )
        return image[0]


class TorchTiles(Rasterizer):
    """``bench.torch_tiles``, on as many threads as torch takes."""

    name = "torch tiles"
    place = "CPU"
    arrays = "torch"
    threads: int | None = None

    def __init__(self, device: rift.Device, case: SplatCase) -> None:
        super().__init__(device, case)
        self._torch = import_module("torch")
        self._tiles = import_module("bench.torch_tiles")
        leaf = self._torch.tensor
        self._parameters = {n: leaf(v, requires_grad=True) for n, v in case.parameters.items()}
        self._background = leaf(case.background, requires_grad=True)
        self._grad_image = leaf(case.grad_image)

    def leave(self, array: Any) -> Floats:
        """A view of the result."""
        found: Floats = array.numpy()
        return found

    def draw(self) -> Any:
        """Draw, and keep nothing for a gradient."""
        with self._torch.no_grad(), self._set():
            return self._image()

    def draw_and_gradient(self) -> Any:
        """Draw and differentiate."""
        for leaf in (*self._parameters.values(), self._background):
            leaf.grad = None
        with self._set():
            (self._image() * self._grad_image).sum().backward()
        return self._parameters["means"].grad

    @contextmanager
    def _set(self) -> Iterator[None]:
        with self._tiles.flushed_denormals(), self._tiles.on_threads(self.threads):
            yield

    def _image(self) -> Any:
        return self._tiles.draw(self._parameters, self.case.camera, self._background)


class TorchTilesAlone(TorchTiles):
    """The same on one thread.

    Torch's threads wait for each other many times in a frame. Where another program takes one of
    the cores, several threads can take ten times as long as one.
    """

    name = "torch tiles, one thread"
    threads = 1


RASTERIZERS: tuple[type[Rasterizer], ...] = (
    RiftRasterizer,
    Gsplat,
    TorchTiles,
    TorchTilesAlone,
)
