"""The photographs of a fit: decoded once, sent to the device one at a time, over their background.

Photographs are kept on the host, in display light as codes of 8 or 16 bits, and are decoded again
whenever they do not fit the budget, the next step's in another thread while a step works; what a
step sees is the same either way. Those that have alpha of their own show what was cut out: they are
laid over a background that is drawn by chance for each step, so that transparent places must become
transparent. Alpha that is the same everywhere, as many programs write it, cuts out nothing. Where a
mask is black, or the photograph did not reach once its lens was undone, nothing is known: such
pixels do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import free_host_memory
from rift_cl.cl.device import Device
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import View, camera_at, read_view
from rift_cl.io.images.display_light import to_display
from rift_cl.io.images.picture_header import read_picture_header

# Share of the free host memory that photographs may take, and of the memory budget of a device that
# computes in the host's memory.
_SHARE, _OF_BUDGET = 0.4, 2 / 3
# What differs by more from the background, or has more alpha, is in front of it.
_FOREGROUND = 2 / 255
# A pixel counts in a score if so much of it is known.
_KNOWN = 0.5
# A border is of one colour if so many of its samples are, to within so many codes.
_UNIFORM, _CODES = 0.8, 1.5

# Values that lie so near to 8-bit codes are such.
_EXACT = 1e-3

Floats = NDArray[np.float32]
Kept = NDArray[Any]
Light = Literal["display", "linear"]


class CapturePictures:
    """Training views; see ``rift_cl.train.TrainingViews``.

    Args:
        device: where pictures are sent.
        views: the photographs.
        downscale: whole factor by which they are made smaller.
        seed: of the random backgrounds.
        light: that pictures are in.
        like: other photographs of the same scene, whose background these have; found if not given.
    """

    def __init__(
        self,
        device: Device,
        views: Sequence[View],
        *,
        downscale: int = 1,
        seed: int = 0,
        light: Light = "display",
        like: CapturePictures | None = None,
    ) -> None:
        self.device = device
        self.views = views
        self.cameras: Sequence[Camera] = [camera_at(view, downscale) for view in views]
        self.light: Light = light
        self._downscale, self._seed = downscale, seed
        self._kept: dict[int, Kept] = {}
        self._own_alpha: dict[int, bool] = {}
        # A step asks for one picture several times.
        self._last: tuple[int, Floats] | None = None
        self._room = int(_SHARE * (free_host_memory() or 1 << 30))
        if device.traits.is_cpu or device.traits.unified:
            self._room = min(self._room, int(_OF_BUDGET * device.budget))
        self._view_at: Callable[[int], int] | None = None
        self._coming: dict[int, Future[Kept]] = {}
        self._reader: ThreadPoolExecutor | None = None
        found = self._common_border() if like is None else like.behind
        self.behind: Floats = np.zeros(3, np.float32) if found is None else found
        self.backed: bool = found is not None if like is None else like.backed
        self._step = 0

    def image(self, number: int) -> Floats:
        """(height, width, 3 or 4), alpha straight."""
        if self._last is None or self._last[0] != number:
            self._last = number, self._decoded(number)
        return self._last[1]

    def keep(self, number: int) -> bool:
        """Read a photograph now; whether there was room to keep it."""
        self._decoded(number)
        return number in self._kept

    def _decoded(self, number: int) -> Floats:
        kept = self._kept.get(number)
        if kept is None:
            coming = self._coming.pop(number, None)
            kept = self._read(number) if coming is None else coming.result()
            if kept.nbytes <= self._room:
                self._room -= kept.nbytes
                self._kept[number] = kept
        most = 1 if kept.dtype.kind == "f" else np.iinfo(kept.dtype).max
        return np.asarray(kept, np.float32) / np.float32(most)

    def _read(self, number: int) -> Kept:
        """A photograph as it is kept; by any thread."""
        image = _without_constant_alpha(
            read_view(self.views[number], downscale=self._downscale, light=self.light)
        )
        return _codes_of(image) if self.light == "display" else image

    def announce(self, view_at: Callable[[int], int]) -> None:
        """Say which photograph each step asks for, so that it is read while the one before works.

        Args:
            view_at: the number of a step's photograph.
        """
        self._view_at = view_at

    def _read_ahead(self, number: int) -> None:
        if number in self._kept or number in self._coming:
            return
        if self._last is not None and self._last[0] == number:
            return
        self._reader = self._reader or ThreadPoolExecutor(1, "read")
        # What was read for a step that never came would only take memory.
        self._coming = {number: self._reader.submit(self._read, number)}

    def over(self, number: int, background: Floats) -> Floats:
        """(height, width, 3) over a background, which also stands where nothing is known."""
        image = self.image(number)
        if image.shape[2] == 3:
            return image
        alpha = image[..., 3:]
        return np.asarray(image[..., :3] * alpha + background * (1 - alpha), np.float32)

    def any_cut_out(self) -> bool:
        """Whether a photograph has alpha of its own."""
        return any(self._is_cut_out(number) for number in range(len(self.views)))

    def _is_cut_out(self, number: int) -> bool:
        """Whether a photograph has alpha of its own, and this is not the same everywhere."""
        if number not in self._own_alpha:
            view = self.views[number]
            own = read_picture_header(view.image).alpha
            if own and view.mask is None and view.lens is None:
                own = self.image(number).shape[2] == 4
            elif own:
                bare = replace(view, mask=None, lens=None)
                own = _without_constant_alpha(read_view(bare)).shape[2] == 4
            self._own_alpha[number] = own
        return self._own_alpha[number]

    def _fills(self, number: int) -> bool:
        """Whether what is cut out of other photographs fills this one."""
        opaque = read_picture_header(self.views[number].image).alpha
        return opaque and any(self._is_cut_out(other) for other in evenly(len(self.views), 8))

    def _shares(self, number: int) -> Floats | None:
        """(height, width) how much of each pixel is known; None where all is."""
        image = self.image(number)
        return None if image.shape[2] == 3 or self._is_cut_out(number) else image[..., 3]

    def counted(self, number: int) -> NDArray[np.bool_] | None:
        """(height, width) the pixels that count; None where all do."""
        shares = self._shares(number)
        return None if shares is None else np.asarray(shares > _KNOWN)

    def shown(self, image: Floats) -> Floats:
        """An image, drawn or photographed, in display light from 0 to 1: as people score it."""
        held = np.clip(image, 0, 1)
        if self.light == "linear":
            to_display(held)
        return held

    def begin(self, step: int) -> None:
        """Announce the next step, which determines the backgrounds."""
        self._step = step
        if self._view_at is not None:
            self.image(self._view_at(step))
            self._read_ahead(self._view_at(step + 1))

    def target(self, number: int) -> Any:
        """The picture on the device, over the background of this step."""
        return self.device.send(self.over(number, self._behind(number)))

    def background(self, number: int) -> Any:
        """What is behind the splats in this step."""
        return self.device.send(self._behind(number))

    def weights(self, number: int) -> Any:
        """(height, width) device array, how much each pixel counts; None where all do."""
        shares = self._shares(number)
        return None if shares is None else self.device.send(np.ascontiguousarray(shares))

    def _behind(self, number: int) -> Floats:
        if self.image(number).shape[2] == 3 or not self._is_cut_out(number):
            return self.behind
        random = np.random.default_rng((self._seed, self._step, 0xBAC))
        return random.uniform(0, 1, 3).astype(np.float32)

    def foreground(self, number: int) -> NDArray[np.bool_] | None:
        """(height, width) foreground mask; None if it is not known."""
        image, counted = self.image(number), self.counted(number)
        if image.shape[2] == 4 and counted is None:
            return np.asarray(image[..., 3] > _FOREGROUND)
        if counted is None and self._fills(number):
            return np.ones(image.shape[:2], bool)
        if not self.backed:
            return None
        front = np.abs(image[..., :3] - self.behind).max(axis=2) > _FOREGROUND
        return np.asarray(front if counted is None else front & counted)

    def nothing_in_front(self) -> bool:
        """Whether a few pictures, evenly chosen, are known to show their background alone."""
        fronts = [self.foreground(number) for number in evenly(len(self.views), 8)]
        return all(front is not None and not front.any() for front in fronts)

    def _common_border(self) -> Floats | None:
        """The colour that all borders of a few pictures have; None if they have none."""
        few = evenly(len(self.views), 8)
        edges = []
        for number in few:
            image, shares = self.image(number)[..., :3], self._shares(number)
            known = np.ones(image.shape[:2], bool) if shares is None else shares > _KNOWN
            for edge in ((0, slice(None)), (-1, slice(None)), (slice(None), 0), (slice(None), -1)):
                edges.append(image[edge][known[edge]])
        border = np.concatenate(edges)
        if not len(border):
            return None
        middle = np.median(border, axis=0)
        same = np.abs(border - middle).max(axis=1) <= _CODES / 255
        return np.asarray(middle, np.float32) if same.mean() >= _UNIFORM else None


def _without_constant_alpha(image: Floats) -> Floats:
    """The colours alone where alpha is one number above 0 everywhere, and so tells nothing."""
    if image.shape[2] == 3:
        return image
    alpha = image[..., 3]
    return image[..., :3] if 0 < alpha.min() == alpha.max() else image


def _codes_of(image: Floats) -> Kept:
    """Codes of 8 bits if the values are such, of 16 bits if not."""
    held = np.clip(image, 0, 1)
    codes = np.rint(held * 255)
    if np.abs(held * 255 - codes).max() <= _EXACT:
        return codes.astype(np.uint8)
    return np.rint(held * 65535).astype(np.uint16)
