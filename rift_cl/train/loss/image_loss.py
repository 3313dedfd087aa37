"""The loss of a splat trainer, pixel differences and SSIM, with its gradient on the device.

Two kernels, each of which blurs down and along at once: ``kernels/train/ssim_map.cl`` derives the
gradient, ``kernels/train/loss_grad.cl`` finishes it. Nothing waits for the device. Between the two
are maps, three times as large as the image: a large image is gone through in bands of rows, whose
maps reach as far as the window does, to the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import check_array, cut_evenly
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number
from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES

_WINDOW, _CHANNELS = 11, 4
_ROWS, _STRIP, _MAPS = 4, 256, 3
# Runs of rows on either side of a band that its gradient reads the maps of: half a window, and the
# rows that a run may have beyond the image.
_BESIDE = 2
# Bytes of the maps of a band: little memory, and what is gone through twice beside it little time.
_MAPS_ROOM = 1 << 24


@dataclass(frozen=True)
class ImageLoss:
    """The mean of ``m ((1 - w) |image - target| + w (1 - SSIM))``, with the weights m.

    SSIM is that of ``rift_cl.metrics.ssim`` without a mask, channel by channel: a Gaussian window
    11 pixels wide with sigma 1.5, population covariance, data range 1, mirrored borders. The mean
    is over all pixels and channels, so that a mask shrinks the loss.

    Args:
        ssim_weight: w, from 0 (no SSIM) to 1 (nothing else).
        kind: pixel loss that stands in place of the absolute difference: ``l1`` or ``l2``, or one
            that was registered.

    Raises:
        InputError: a setting is out of its range.
    """

    ssim_weight: float = 0.2
    kind: str = "l1"

    def __post_init__(self) -> None:
        """Check every setting's range."""
        if not 0 <= one_number(self.ssim_weight) <= 1:
            raise InputError(
                f"ImageLoss: ssim_weight is {self.ssim_weight!r}, wanted a number from 0 to 1"
            )
        PIXEL_LOSSES[self.kind]

    def __call__(
        self,
        device: Device,
        image: DeviceArray,
        target: DeviceArray,
        *,
        weights: DeviceArray | None = None,
    ) -> tuple[DeviceArray, DeviceArray]:
        """The loss and its gradient, as device arrays whose bits do not depend on timing.

        Args:
            device: where the arrays are.
            image: (height, width, D); channels behind those of the target do not count.
            target: (height, width, C), at most 4 channels.
            weights: m, (height, width), from 0 to 1; one if not given. They weigh the map of
                SSIM: pixels that do not count still stand in the windows of those that do, unlike
                in ``metrics.ssim``, so that the gradient is not zero up to 5 pixels from these.

        Returns:
            The loss, (1,), and its gradient by the image, (height, width, D). Values are taken
            as they are: a NaN among the channels that count makes the loss NaN.

        Raises:
            ShapeError: shapes do not fit, or a side is shorter than the window of SSIM.
            DTypeError: an array is not float32 on a device.
            DeviceError: an array belongs to another device.
            ResourceLimitError: a few rows are larger than the device's largest buffer.
        """
        _check(device, image, target, weights)
        _check_window(target.shape[:2], self.ssim_weight)
        return self._launch(device, image, target, weights)

    def _launch(
        self, device: Device, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
    ) -> tuple[DeviceArray, DeviceArray]:
        height, width, channels = target.shape
        floats, w, n = width * channels, float(self.ssim_weight), target.size
        tiles = -(-floats // _STRIP), -(-height // _ROWS)
        size = (tiles[0] * device.traits.macros["GROUP"], tiles[1])
        items = size[0] * size[1]
        macros = {"CHANNELS": channels, "IMAGE_CHANNELS": image.shape[2]}
        macros |= {"ROWS": _ROWS, "STRIP": _STRIP, "WEIGHTED": weights is not None}
        # Kernels that have no weights or maps still take an array in their place.
        arrays, maps = {"image": image, "target": target}, target
        arrays["weights"] = target if weights is None else weights
        grad, parts = device.empty(image.shape), device.empty(((2 if w else 1) * items, 1))
        sizes = {"height": height, "width": floats, "pitch": _pitch(floats)}
        bands = _bands(device, tiles[1], sizes["pitch"]) if w else [slice(0, tiles[1])]
        if w:
            most = max(_rows_beside(band, height)[1] for band in bands)
            maps = device.empty((_MAPS, most, sizes["pitch"]))
        for band in bands:
            first, rows = _rows_beside(band, height)
            of_maps = {"maps": maps, "parts": parts, "map_first": first, "map_rows": rows}
            if w:
                device.launch(
                    "ssim_map",
                    (size[0], -(-rows // _ROWS)),
                    **arrays,
                    **of_maps,
                    first_run=first // _ROWS,
                    **sizes,
                    scale=w / n,
                    **macros,
                )
            device.launch(
                "loss_grad",
                (size[0], band.stop - band.start),
                **arrays,
                **of_maps,
                grad=grad,
                first_part=items if w else 0,
                first_run=band.start,
                **sizes,
                pixel_scale=(1 - w) / n,
                ssim_scale=w / n,
                **macros,
                SSIM=w > 0,
                **PIXEL_LOSSES[self.kind].macros(),
            )
        return sum_columns(device, parts), grad


def _bands(device: Device, runs: int, pitch: int) -> list[slice]:
    """Runs of rows whose maps, with those beside them, are small beside a large image.

    Raises:
        ResourceLimitError: a buffer of the device does not hold those of one run.
    """
    each = 4 * _MAPS * _ROWS * pitch
    least = (1 + 2 * _BESIDE) * each
    room = min(max(_MAPS_ROOM, least), device.traits.allocation)
    if runs * each <= room:
        return [slice(0, runs)]
    check_array(least, room, what="the map of SSIM of a few rows")
    return cut_evenly(runs, room // each - 2 * _BESIDE)


def _rows_beside(band: slice, height: int) -> tuple[int, int]:
    """The first row of the maps of a band, and how many there are."""
    first = _ROWS * max(band.start - _BESIDE, 0)
    return first, min(_ROWS * (band.stop + _BESIDE), height) - first


def _pitch(floats: int) -> int:
    """Floats from row to row of a map: an odd number of cache lines.

    Rows a power of two apart would push each other out of a cache while they are blurred down.
    """
    return (-(-floats // 16) | 1) * 16


def _check(
    device: Device, image: DeviceArray, target: DeviceArray, weights: DeviceArray | None
) -> None:
    for name, array in (("image", image), ("target", target)):
        shape = getattr(array, "shape", ())
        as_device_array(device, array, shape, name=name)
        if len(shape) != 3 or 0 in shape:
            raise ShapeError(f"{name} has shape {shape}, wanted (height, width, channels)")
    *size, channels = target.shape
    if channels > _CHANNELS:
        raise ShapeError(f"target has {channels} channels, wanted 1 to {_CHANNELS}")
    if list(image.shape[:2]) != size or image.shape[2] < channels:
        raise ShapeError(
            f"image has shape {image.shape}, wanted the size of the target, {target.shape}, and "
            "at least its channels"
        )
    if weights is not None:
        as_device_array(device, weights, tuple(size), name="weights")


def _check_window(size: tuple[int, ...], ssim_weight: float) -> None:
    if ssim_weight and min(size) < _WINDOW:
        raise ShapeError(
            f"image has {size[0]} x {size[1]} pixels, SSIM wants {_WINDOW} or more along each "
            "side: set ssim_weight to 0"
        )
