"""The loss of a fit, homogenised: its gradient is weighted in the Fourier domain of the image.

``rift_cl.train.loss.homogenisation`` says why and how strongly.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.operators.fourier.spectrum import Response, SpectralFilter
from rift_cl.train.loss.coverage_weight import CoverageWeight
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.loss.image_loss import ImageLoss

# Exponents are rounded to so many parts of the largest, so that responses can be kept.
_PARTS = 32
# Bytes of responses that are kept; those of further views are made anew at every look.
_KEPT = 64 << 20
# Share of the old value in the running mean of the squared residual.
_MEMORY = 0.8


class HomogenisedLoss:
    """The loss of a fit, and its gradient by the image.

    Args:
        device: where the images are.
        settings: how strongly frequencies are weighted; exponent 0 leaves the plain loss.
        ssim_weight: share of D-SSIM.
        kind: of the pixelwise part.
        noise: standard deviation of the noise in the pictures.
        coverage: of the views; wanted where the settings weigh by it.

    Raises:
        InputError: it is wanted and missing.
    """

    def __init__(
        self,
        device: Device,
        settings: Homogenisation,
        *,
        ssim_weight: float,
        kind: str,
        noise: float = 0.0,
        coverage: CoverageWeight | None = None,
    ) -> None:
        self.device = device
        self.settings = settings
        if settings.weight == "ramp":
            coverage = None
        elif coverage is None and settings.exponent:
            raise InputError("HomogenisedLoss: weight is 'coverage', wanted the views' coverage")
        self.coverage = coverage
        self.noise = noise
        self.mean_square = float("inf")
        self._plain = ImageLoss(ssim_weight=ssim_weight, kind=kind)
        self._pixels = ImageLoss(ssim_weight=0.0, kind=kind)
        self._structure = ImageLoss(ssim_weight=1.0)
        self._squares = ImageLoss(ssim_weight=0.0, kind="l2")
        self._shapes: dict[tuple[int, ...], SpectralFilter] = {}
        self._filters: dict[tuple[tuple[int, ...], int], SpectralFilter] = {}
        self._filtered = 0.0

    @property
    def exponent(self) -> float:
        """The exponent that holds now."""
        most = self.settings.exponent or 0.0
        share = self.settings.exponent_at(self.mean_square, self.noise) / most if most else 0.0
        return round(share * _PARTS) / _PARTS * most

    def __call__(
        self, image: Any, target: Any, *, weights: Any = None, view: int = 0, shrink: int = 1
    ) -> tuple[Any, Any]:
        """The loss, (1,), and its weighted gradient, as ``ImageLoss`` gives them.

        The ramp spreads a residual; what comes to lie on pixels that do not count is left out.
        ``view`` is the picture's number, which coverage hangs on, and ``shrink`` how many of its
        camera's pixels one of the image is long.
        """
        exponent = self.exponent
        if exponent == 0:
            return self._plain(self.device, image, target, weights=weights)
        value, gradient = self._pixels(self.device, image, target, weights=weights)
        ramp = self._filter(image.shape[:2], exponent, view, shrink)
        gradient = ramp(gradient, channels=target.shape[2], mask=weights, keep_norm=True)
        share = self._plain.ssim_weight
        if share:
            structure, by_structure = self._structure(self.device, image, target, weights=weights)
            axpby(self.device, share, structure, 1 - share, value)
            axpby(self.device, share, by_structure, 1 - share, gradient)
        return value, gradient

    def watch(self, image: Any, target: Any, *, weights: Any = None) -> None:
        """Take note of how much is left: one picture's mean square residual; waits for it."""
        if not (self.settings.exponent and self.settings.noise_aware and self.noise):
            return
        squares = self._squares(self.device, image, target, weights=weights)[0]
        found = float(self.device.get(squares)[0])
        known = np.isfinite(self.mean_square)
        self.mean_square = _MEMORY * self.mean_square + (1 - _MEMORY) * found if known else found

    def state(self) -> dict[str, NDArray[np.float64]]:
        """What a checkpoint keeps."""
        return {"mean_square": np.array(self.mean_square), "noise": np.array(self.noise)}

    def restore(self, state: Mapping[str, NDArray[np.float64]]) -> None:
        """Go on from a checkpoint."""
        self.mean_square, self.noise = float(state["mean_square"]), float(state["noise"])

    def _filter(
        self, size: tuple[int, ...], exponent: float, view: int, shrink: int
    ) -> SpectralFilter:
        """The filter of a view's image, kept while the exponent holds."""
        if exponent != self._filtered:
            self._filters, self._filtered = {}, exponent
        key = size, 0 if self.coverage is None else view
        if key in self._filters:
            return self._filters[key]
        response = self._response(size, exponent, view, shrink)
        if size in self._shapes:
            found = self._shapes[size].with_response(response)
        else:
            found = SpectralFilter(self.device, (size[0], size[1]), response)
            self._shapes[size] = found
        if (len(self._filters) + 1) * 4 * found.padded[0] * found.padded[1] <= _KEPT:
            self._filters[key] = found
        return found

    def _response(self, size: tuple[int, ...], exponent: float, view: int, shrink: int) -> Response:
        if self.coverage is not None:
            return self.coverage.response(view, exponent, shrink)
        return partial(self.settings.response, longest=max(size), exponent=exponent)
