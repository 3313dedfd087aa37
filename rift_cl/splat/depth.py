"""Expected depth: accumulated depth divided by alpha, in the last channel of an image."""

from __future__ import annotations

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.memory import as_device_array
from rift_cl.splat.raster import Raster


def expected_depth(device: Device, raster: Raster) -> None:
    """Turn the last channel from accumulated into expected depth, in place."""
    height, width, channels = raster.image.shape
    pixels = height * width
    device.launch(
        "expected_depth",
        (pixels,),
        image=raster.image,
        transmittance=raster.transmittance,
        pixels=pixels,
        channels=channels,
    )


def expected_depth_grad(
    device: Device,
    raster: Raster,
    grad_image: DeviceArray,
    grad_transmittance: DeviceArray | None = None,
) -> tuple[DeviceArray, DeviceArray]:
    """The gradient by the image with accumulated depth, and by the transmittance.

    Args:
        device: where the arrays are.
        raster: after ``expected_depth``.
        grad_image: (height, width, D) by the image.
        grad_transmittance: (height, width); zero if not given.
    """
    height, width, channels = raster.image.shape
    if grad_transmittance is None:
        grad_transmittance = device.zeros((height, width))
    as_device_array(device, grad_transmittance, (height, width), name="grad_transmittance")
    by_image, by_transmittance = device.empty(raster.image.shape), device.empty((height, width))
    device.launch(
        "expected_depth_grad",
        (height * width,),
        image=raster.image,
        transmittance=raster.transmittance,
        grad_image=grad_image,
        grad_transmittance=grad_transmittance,
        by_image=by_image,
        by_transmittance=by_transmittance,
        pixels=height * width,
        channels=channels,
    )
    return by_image, by_transmittance
