"""The photographs of a fit: decoded once, sent to the device one at a time, over their background.

Photographs are kept on the host, in display light as codes of 8 or 16 bits where these reach all of
their numbers, and are decoded again whenever they do not fit the budget, the next step's in another
thread while a step works; what a step sees is the same either way. Those that have alpha of their
own show what was cut out: they are laid over a background that is drawn by chance for each step, so
that transparent places must become transparent. Alpha that is the same everywhere, as many programs
write it, cuts out nothing. Where a mask is black, or the photograph did not reach once its lens was
undone, nothing is known, whatever alpha says: such pixels do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import free_host_memory
from rift_cl.cl.device import Device
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import View, camera_at, read_known_view
from rift_cl.io.images.display_light import LightKind, to_display
from rift_cl.io.images.read_picture import read_picture_header

# Share of the free host memory that photographs may take, and of the memory budget of a device that
# computes in the host's memory.
_SHARE, _OF_BUDGET = 0.4, 2 / 3
# What differs by more from the background, or has more alpha, is in front of it.
_FOREGROUND = 2 / 255
# A pixel counts in a score if so much of it is known.
_KNOWN = 0.5
# A border is of one colour if so many of its samples are, to within so many codes.
_UNIFORM, _CODES = 0.8, 1.5

# Values that lie so near to 8-bit codes are such, and that lie so little beyond 0 to 1 are rounded.
_EXACT, _BESIDE = 1e-3, 1 / 65535

Floats = NDArray[np.float32]
Kept = NDArray[Any]


class _Photograph(NamedTuple):
    """A photograph in display or linear light, as numbers or as the codes that are kept.

    Args:
        image: (height, width, 3 or 4), alpha straight.
        known: (height, width) the share of each pixel that is known; None where all is.
    """

    image: Kept
    known: Kept | None

    @property
    def nbytes(self) -> int:
        """Bytes of both arrays."""
        return self.image.nbytes + (0 if self.known is None else self.known.nbytes)


class CapturePictures:
    """Training views; see ``rift_cl.train.TrainingViews``.

    Args:
        device: where pictures are sent.
        views: the photographs.
        downscale: whole factor by which they are made smaller.
        seed: of the random backgrounds.
        light: that pictures are in.
        like: other photographs of the same scene, whose border and background these have.
        background: what is behind the splats, in ``light``; that of ``like`` if not given, or the
            colour that the photographs' borders have in common, or black without one.
    """

    def __init__(
        self,
        device: Device,
        views: Sequence[View],
        *,
        downscale: int = 1,
        seed: int = 0,
        light: LightKind = "display",
        like: CapturePictures | None = None,
        background: Floats | None = None,
    ) -> None:
        self.device = device
        self.views = views
        self.cameras: Sequence[Camera] = [camera_at(view, downscale) for view in views]
        self.light: LightKind = light
        self._downscale, self._seed = downscale, seed
        self._kept: dict[int, _Photograph] = {}
        self._own_alpha: dict[int, bool] = {}
        # A step asks for one picture several times.
        self._last: tuple[int, _Photograph] | None = None
        self._room = int(_SHARE * (free_host_memory() or 1 << 30))
        if device.traits.is_cpu or device.traits.unified:
            self._room = min(self._room, int(_OF_BUDGET * device.budget))
        self._view_at: Callable[[int], int] | None = None
        self._coming: dict[int, Future[_Photograph]] = {}
        self._reader: ThreadPoolExecutor | None = None
        self.border: Floats | None = self._common_border() if like is None else like.border
        if background is None:
            background = self.border if like is None else like.behind
        self.behind: Floats = np.zeros(3, np.float32) if background is None else background
        self._step = 0

    def placed(self, cameras: Sequence[Camera]) -> CapturePictures:
        """The same photographs, taken by other cameras, one for each."""
        others = copy(self)
        others.cameras = cameras
        return others

    def image(self, number: int) -> Floats:
        """(height, width, 3), or 4 with the photograph's own alpha, straight."""
        return self._photograph(number).image

    def known(self, number: int) -> Floats | None:
        """(height, width) the share of each pixel that is known; None where all is."""
        return self._photograph(number).known

    def _photograph(self, number: int) -> _Photograph:
        if self._last is None or self._last[0] != number:
            self._last = number, self._decoded(number)
        return self._last[1]

    def keep(self, number: int) -> bool:
        """Read a photograph now; whether there was room to keep it."""
        self._decoded(number)
        return number in self._kept

    def _decoded(self, number: int) -> _Photograph:
        kept = self._kept.get(number)
        if kept is None:
            coming = self._coming.pop(number, None)
            kept = self._read(number) if coming is None else coming.result()
            if kept.nbytes <= self._room:
                self._room -= kept.nbytes
                self._kept[number] = kept
        return _Photograph(_numbers(kept.image), _optional(_numbers, kept.known))

    def _read(self, number: int) -> _Photograph:
        """A photograph as it is kept; by any thread."""
        image, known = read_known_view(
            self.views[number], downscale=self._downscale, light=self.light
        )
        image = _without_constant_alpha(image, known)
        if self.light == "linear":
            return _Photograph(image, known)
        return _Photograph(_codes_of(image), _optional(_codes_of, known))

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
        image, known = self._photograph(number)
        if image.shape[2] == 3 and known is None:
            return image
        cover = image[..., 3:] if image.shape[2] == 4 else np.ones_like(image[..., :1])
        if known is not None:
            # Colours are those of what is known of a pixel, of however little.
            cover = cover * (known > 0)[..., None]
        return np.asarray(image[..., :3] * cover + background * (1 - cover), np.float32)

    def any_cut_out(self) -> bool:
        """Whether a photograph has alpha of its own."""
        return any(self._is_cut_out(number) for number in range(len(self.views)))

    def _is_cut_out(self, number: int) -> bool:
        """Whether a photograph has alpha of its own, and this is not the same everywhere."""
        if number not in self._own_alpha:
            alpha = read_picture_header(self.views[number].image).alpha
            self._own_alpha[number] = alpha and self.image(number).shape[2] == 4
        return self._own_alpha[number]

    def _fills(self, number: int) -> bool:
        """Whether what is cut out of other photographs fills this one."""
        opaque = read_picture_header(self.views[number].image).alpha
        return opaque and any(self._is_cut_out(other) for other in evenly(len(self.views), 8))

    def counted(self, number: int) -> NDArray[np.bool_] | None:
        """(height, width) the pixels that count; None where all do."""
        known = self.known(number)
        return None if known is None else np.asarray(known > _KNOWN)

    def shown(self, image: Floats) -> Floats:
        """An image, drawn or photographed, in display light from 0 to 1: as people score it.

        A screen shows no more of either, so that numbers beyond count as white and black.
        """
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
        known = self.known(number)
        return None if known is None else self.device.send(known)

    def _behind(self, number: int) -> Floats:
        if self.image(number).shape[2] == 3:
            return self.behind
        random = np.random.default_rng((self._seed, self._step, 0xBAC))
        return random.uniform(0, 1, 3).astype(np.float32)

    def foreground(self, number: int) -> NDArray[np.bool_] | None:
        """(height, width) foreground mask; None if it is not known."""
        image, counted = self.image(number), self.counted(number)
        if image.shape[2] == 4:
            front = image[..., 3] > _FOREGROUND
        elif self._fills(number):
            front = np.ones(image.shape[:2], bool)
        elif self.border is not None:
            front = np.abs(image - self.border).max(axis=2) > _FOREGROUND
        else:
            return None
        return np.asarray(front if counted is None else front & counted)

    def nothing_in_front(self) -> bool:
        """Whether a few pictures, evenly chosen, are known to show their background alone."""
        fronts = [self.foreground(number) for number in evenly(len(self.views), 8)]
        return all(front is not None and not front.any() for front in fronts)

    def _common_border(self) -> Floats | None:
        """The colour that all borders of a few pictures have; None if they have none.

        Cut-out pictures have none: where they are transparent, their colours mean nothing.
        """
        few = evenly(len(self.views), 8)
        if any(self._is_cut_out(number) for number in few):
            return None
        border = np.concatenate([self._border(number) for number in few])
        if not len(border):
            return None
        middle = np.median(border, axis=0)
        same = np.abs(border - middle).max(axis=1) <= _CODES / 255
        return np.asarray(middle, np.float32) if same.mean() >= _UNIFORM else None

    def _border(self, number: int) -> Floats:
        """(samples, 3) what counts along the border of what a photograph reaches."""
        image, counted = self.image(number), self.counted(number)
        places = _outline(self._reached(number))
        colors = image[places]
        return colors if counted is None else colors[counted[places]]

    def _reached(self, number: int) -> NDArray[np.bool_]:
        """(height, width) where a photograph reaches once its lens is undone, masked or not.

        A mask's own edge may run along the object: it is no border of the photograph.
        """
        view, counted = self.views[number], self.counted(number)
        ends_inside = view.lens is not None or view.crop_radius is not None
        if ends_inside and view.mask is not None:
            bare = replace(view, mask=None)
            _, known = read_known_view(bare, downscale=self._downscale, light=self.light)
            return np.asarray(known) > _KNOWN
        if not ends_inside or counted is None:
            return np.ones(self.image(number).shape[:2], bool)
        return counted


def _outline(reached: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the first and the last pixel that is reached of each row and column."""
    rows, columns = (np.flatnonzero(reached.any(axis=axis)) for axis in (1, 0))
    last_row, last_column = (side - 1 for side in reached.shape)
    sides = (
        (rows, reached.argmax(axis=1)[rows]),
        (rows, last_column - reached[:, ::-1].argmax(axis=1)[rows]),
        (reached.argmax(axis=0)[columns], columns),
        (last_row - reached[::-1].argmax(axis=0)[columns], columns),
    )
    along = [np.concatenate(places) for places in zip(*sides, strict=True)]
    return along[0], along[1]


def _without_constant_alpha(image: Floats, known: Floats | None) -> Floats:
    """The colours alone where what is known has one alpha above 0, which so tells nothing."""
    if image.shape[2] == 3:
        return image
    alpha = image[..., 3] if known is None else image[..., 3][known > 0]
    # One number is no longer the same to the last bit once it was averaged by a mask.
    tells = alpha.size > 0 and not 0 < alpha.min() >= alpha.max() - _EXACT / 255
    return image if tells else image[..., :3]


def _optional(function: Callable[[Kept], Kept], array: Kept | None) -> Kept | None:
    return None if array is None else function(array)


def _numbers(kept: Kept) -> Floats:
    """What codes stand for."""
    most = 1 if kept.dtype.kind == "f" else np.iinfo(kept.dtype).max
    return np.asarray(kept, np.float32) / np.float32(most)


def _codes_of(image: Floats) -> Kept:
    """Codes of 8 bits if the values are such, else of 16 bits; what these do not reach as it is."""
    if image.min(initial=0) < -_BESIDE or image.max(initial=0) > 1 + _BESIDE:
        return image
    held = np.clip(image, 0, 1)
    codes = np.rint(held * 255)
    if np.abs(held * 255 - codes).max() <= _EXACT:
        return codes.astype(np.uint8)
    return np.rint(held * 65535).astype(np.uint16)
