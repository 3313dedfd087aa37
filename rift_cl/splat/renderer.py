"""The renderer: splats to an image and back, resident on the device.

``forward`` keeps what its gradient needs in a ``Frame``; ``backward`` turns dL/d image into
gradients of every parameter. Nothing is summed by atomics, so the same call gives the same bits,
and so it does in a smaller memory budget, in which the image is drawn in bands. ``picture`` renders
to the host, images too that the device does not hold.
"""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.adam import AdamStep
from rift_cl.cl.arithmetic import copy_columns, sum_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.host_arrays import as_device_array, download
from rift_cl.errors import InputError, ResourceLimitError, check_type
from rift_cl.geometry import Camera
from rift_cl.splat.bands import FrameMemory, PictureMemory, check_fixed
from rift_cl.splat.environment import shade_environment_grad
from rift_cl.splat.features import Channels, gather_features, own_columns, shade_grad
from rift_cl.splat.given_up import MayBeGivenUp, give_up
from rift_cl.splat.projection import (
    CULL_REASONS,
    Projection,
    SplatGradients,
    check_modal,
    project,
    project_grad,
)
from rift_cl.splat.raster import Raster, ScreenSplats, unpack
from rift_cl.splat.raster_pass import RasterPass, draw, draw_bands, draw_grad
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats
from rift_cl.splat.tile_lists import TileLists

# Pixels that one work-item of a CPU goes through.
_PIXEL_RUN = 1024

DepthKind = Literal["accumulated", "expected", "median"]


@dataclass(frozen=True, eq=False, repr=False)
class Frame(MayBeGivenUp):
    """A rendered image with what its gradient needs.

    Args:
        projection: what was drawn, and how the camera sees it.
        depth: ``accumulated``, ``expected``, ``median``, or None.
        channels: what the image's channels are.
        raster_pass: the splats on the screen, the image, and what the raster left for its gradient.
    """

    projection: Projection
    depth: str | None
    channels: Channels
    raster_pass: RasterPass

    @property
    def image(self) -> DeviceArray:
        """(height, width, D) device array, the background included; ``get`` copies it to NumPy."""
        return self.raster_pass.raster.image

    @property
    def transmittance(self) -> DeviceArray:
        """(height, width) device array, what of the background is seen; alpha is one minus it."""
        return self.raster_pass.raster.transmittance

    @property
    def splats(self) -> Splats:
        """The rendered splats."""
        return self.projection.splats

    @property
    def camera(self) -> Camera:
        """What drew it."""
        return self.projection.camera

    @property
    def lists(self) -> TileLists | None:
        """The tile lists.

        None where the image was rendered in bands, and where a gradient has used them up.
        """
        return self.raster_pass.lists

    @property
    def raster(self) -> Raster:
        """The image, and what the raster left for its gradient."""
        return self.raster_pass.raster

    def taken_over(self) -> Frame:
        """A frame with all that this one has, which has nothing any more."""
        done = self.raster_pass
        done = replace(done, raster=copy(done.raster), screen=copy(done.screen))
        found = Frame(copy(self.projection), self.depth, self.channels, done)
        give_up(self, "projection", "raster_pass")
        return found


class Picture(NamedTuple):
    """A rendered image on the host.

    Args:
        image: (height, width, D), the background included.
        transmittance: (height, width), what of the background is seen; alpha is one minus it.
    """

    image: NDArray[np.float32]
    transmittance: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FrameGradients:
    """Gradients of a loss by everything that a frame was made of; device arrays.

    Args:
        splats: by the splats' parameters and their positions on the screen.
        colors: (N, D) by the splats' own colours; None where they have none.
        sh: (N, K, 3) by the spherical harmonics; None where there are none, or where ``backward``
            took a step along them.
        camera: (16,): by the upper three rows of the view matrix, then fx, fy, cx, cy; None if
            not asked for.
        aperture: (2,): by the aperture's radius and focus; None if the camera's is not asked
            for, or has none.
        background: by the background as it was given; None where there was none.
        lobes: (N, G) by the geometry of the lobes; None where there are none.
        normals: (N, 3) by the normals of splats that reflect an environment light; None where there
            is none.
        reflectance: (N, 7) by how they reflect it; likewise.
        environment: (K, 3) by the logarithms of that light's radiance; likewise.
    """

    splats: SplatGradients
    colors: DeviceArray | None
    sh: DeviceArray | None
    camera: DeviceArray | None
    aperture: DeviceArray | None
    background: DeviceArray | None
    lobes: DeviceArray | None = None
    normals: DeviceArray | None = None
    reflectance: DeviceArray | None = None
    environment: DeviceArray | None = None

    @property
    def shape_modes(self) -> DeviceArray | None:
        """(N, K - 1) by the modes of the densities; None where there are none."""
        return self.splats.shape_modes

    @property
    def color_modes(self) -> DeviceArray | None:
        """(N, K - 1, C) by the modes of the colours; None where there are none."""
        return self.splats.color_modes


def check_depth(depth: str | None, settings: SplatSettings) -> None:
    """Check what depth is asked for.

    Raises:
        InputError: it is none that there is, or there is none in this mode.
    """
    if depth is not None and depth not in get_args(DepthKind):
        raise InputError(f"depth is {depth!r}, wanted None, {', '.join(get_args(DepthKind))}")
    if depth is not None and settings.mode == "xray":
        raise InputError("depth has no meaning in xray mode, in which nothing hides anything")


class Renderer:
    """Renders splats, and differentiates the image.

    Args:
        settings: every switch of the rasterizer.
        device: where to work; the default device if not given.
    """

    def __init__(
        self, settings: SplatSettings | None = None, *, device: Device | None = None
    ) -> None:
        self.settings = settings or SplatSettings()
        self.device = device or default_device()
        check_type("Renderer", "settings", self.settings, SplatSettings)
        check_type("Renderer", "device", self.device, Device)

    def forward(
        self,
        splats: Splats,
        camera: Camera,
        *,
        background: DeviceArray | None = None,
        depth: DepthKind | None = None,
    ) -> Frame:
        """Render splats.

        The channels of the image are three colours if the splats have ``sh``, then their
        ``colors`` if they have any, then depth if it is asked for.

        Args:
            splats: parameters on this renderer's device.
            camera: the view.
            background: (D,) device array, for all channels but depth; black if not given. Depth
                has none, and in xray mode there is none.
            depth: draw depth along the camera's axis, or distance from a fisheye, as the last
                channel: ``accumulated``, the sum of weights times depths; ``expected``, that
                divided by alpha; or ``median``, the depth of the splat that leaves half of the
                light, or of the last one that is seen where none does. Where splats lie before a
                surface and behind it, the expected depth is that of neither. The median has no
                gradient.

        Returns:
            The frame: ``.image`` (height, width, D), ``.transmittance`` (height, width), and what
            ``backward`` needs of it.

        Raises:
            InputError: there is nothing to draw, no depth or no lens in this mode, or splats
                with modes have more than 32 channels or shall have magnitudes of gradients.
            ShapeError: the background or the lobes do not fit.
            ResourceLimitError: the image does not fit the memory budget or the largest buffer, or
                not even the lists of one row of tiles do.
        """
        device = self.device
        settings, channels = self._checked(splats, camera, depth)
        memory = FrameMemory.of(splats, camera.size, channels.total, settings)
        check_fixed(memory, device.budget, device.traits.allocation)
        behind = self._behind(background, channels)
        projection = project(device, splats, camera, settings)
        raster_pass = draw(
            device,
            *_on_screen(projection, channels, depth),
            settings=settings,
            memory=memory,
            background=behind,
        )
        if depth == "expected":
            _expected_depth(device, raster_pass.raster)
        return Frame(projection, depth, channels, raster_pass)

    def picture(
        self,
        splats: Splats,
        camera: Camera,
        *,
        background: DeviceArray | None = None,
        depth: DepthKind | None = None,
    ) -> Picture:
        """Render splats to the host, an image that the device does not hold band by band.

        Arguments, channels and bits are those of ``forward``, and so are the errors, but that only
        one row of tiles must fit.
        """
        device = self.device
        settings, channels = self._checked(splats, camera, depth)
        memory = FrameMemory.of(splats, camera.size, channels.total, settings)
        with suppress(ResourceLimitError):
            frame = self.forward(splats, camera, background=background, depth=depth)
            return Picture(device.get(frame.image), device.get(frame.transmittance))
        # Out here, since what was made before an error lives as long as it is handled.
        return self._in_bands(splats, camera, background, depth, memory)

    def _in_bands(
        self,
        splats: Splats,
        camera: Camera,
        background: DeviceArray | None,
        depth: DepthKind | None,
        whole: FrameMemory,
    ) -> Picture:
        device = self.device
        settings, channels = self._checked(splats, camera, depth)
        memory = PictureMemory.within(whole, settings.edge**2)
        check_fixed(memory, device.budget, device.traits.allocation)
        behind = self._behind(background, channels)
        image = np.empty((*camera.size, channels.total), np.float32)
        rest = np.empty(camera.size, np.float32)
        for band in draw_bands(
            device,
            *_on_screen(project(device, splats, camera, settings), channels, depth),
            settings=settings,
            memory=memory,
            background=behind,
        ):
            if depth == "expected":
                _expected_depth(device, band)
            rows = slice(band.above, band.above + len(band.image))
            download(device, band.image, image[rows])
            download(device, band.transmittance, rest[rows])
            # Gone before the next one is made.
            del band
        return Picture(image, rest)

    def backward(
        self,
        frame: Frame,
        grad_image: DeviceArray,
        grad_transmittance: DeviceArray | None = None,
        *,
        with_camera: bool = False,
        with_background: bool = True,
        sh_step: AdamStep | None = None,
        retain: bool = True,
    ) -> FrameGradients:
        """The gradient of a loss by everything that made a frame.

        Args:
            frame: what ``forward`` returned.
            grad_image: dL/d image, (height, width, D) device array.
            grad_transmittance: dL/d transmittance, (height, width); zero if not given.
            with_camera: differentiate by pose, intrinsics and aperture as well.
            with_background: differentiate by the background, if there is one.
            sh_step: a step of Adam that the splats' ``sh`` take in place as soon as their gradient
                is known, which then is not kept: ``FrameGradients.sh`` is None, and the frame's
                splats are others. Lobes evaluated on the host take no step and have a gradient.
            retain: keep the frame. Otherwise it holds nothing afterwards, no image either: its
                arrays, a sixth of what a large scene takes with its gradients, are given up one
                after the other, each as soon as it is not needed.

        Returns:
            Gradients as device arrays: by the splats' geometry ``.splats.means``,
            ``.splats.quats``, ``.splats.scales``, ``.splats.opacities``; by what they show ``.sh``
            or ``.colors``; ``.camera`` and ``.background``. What the splats have not, or was not
            asked for, is None (see ``FrameGradients``).

        Raises:
            InputError: the frame has the median depth, which has no gradient.
            ShapeError: a gradient does not fit the frame.
            ResourceLimitError: not even one row of tiles fits the memory budget.
        """
        if frame.depth == "median":
            raise InputError("the median depth has no gradient: draw the expected one")
        device = self.device
        as_device_array(device, grad_image, frame.image.shape, name="grad_image")
        if grad_transmittance is not None:
            size = frame.transmittance.shape
            as_device_array(device, grad_transmittance, size, name="grad_transmittance")
        if not retain:
            frame = frame.taken_over()
            give_up(frame.projection, "screen", "depths", "boxes")
        if frame.depth == "expected":
            grad_image, grad_transmittance = _expected_depth_grad(
                device, frame.raster, grad_image, grad_transmittance
            )
        sums = draw_grad(device, frame.raster_pass, grad_image, grad_transmittance, last=not retain)
        # Before the gradients are there; a second gradient of the frame packs again.
        unpack(frame.raster_pass.screen)
        gradients = project_grad(
            frame.projection,
            sums,
            with_camera=with_camera,
            depth_channel=frame.depth is not None,
        )
        del sums
        sh, lobes = self._shade_grad(frame, gradients, sh_step)
        light = self._environment_grad(frame, gradients)
        return FrameGradients(
            splats=gradients,
            colors=own_columns(device, gradients.features, frame.channels),
            sh=sh,
            camera=_summed(device, gradients.camera),
            aperture=_summed(device, gradients.aperture),
            background=self._background_grad(frame, grad_image) if with_background else None,
            lobes=lobes,
            **light,
        )

    def culled(self, frame: Frame) -> dict[str, int]:
        """How many splats were left out of a frame, by reason."""
        codes = np.bincount(self.device.get(frame.projection.culled), minlength=len(CULL_REASONS))
        return {
            reason: int(count) for reason, count in zip(CULL_REASONS, codes, strict=True) if count
        }

    def _shade_grad(
        self, frame: Frame, gradients: SplatGradients, sh_step: AdamStep | None
    ) -> tuple[DeviceArray | None, DeviceArray | None]:
        """By the coefficients of shaded colours and by their lobes; None where there are none."""
        splats, device = frame.splats, self.device
        if splats.sh is None:
            return None, None
        lobes = None if splats.lobes is None else device.empty(splats.lobes.shape)
        sh = shade_grad(
            device,
            *(splats.means, splats.sh, frame.camera),
            features=frame.raster_pass.screen.features,
            gradients=gradients,
            lobes=splats.lobes,
            angular=self.settings.angular,
            grad_lobes=lobes,
            sh_step=sh_step,
        )
        return sh, lobes

    def _environment_grad(self, frame: Frame, gradients: SplatGradients) -> dict[str, DeviceArray]:
        """By the environment light and how it is reflected; empty where there is none."""
        splats, features = frame.splats, frame.raster_pass.screen.features
        if splats.environment is None:
            return {}
        given = (self.device, splats, frame.camera)
        return shade_environment_grad(*given, features=features, gradients=gradients)._asdict()

    def _checked(
        self, splats: Splats, camera: Camera, depth: DepthKind | None
    ) -> tuple[SplatSettings, Channels]:
        """How the image is drawn, its tiles' edge chosen, and what its channels are."""
        settings = self.settings.for_image(camera.size, cpu=self.device.traits.is_cpu)
        check_modal(splats, settings)
        check_depth(depth, settings)
        return settings, Channels.of(splats, depth=depth is not None)

    def _behind(self, background: DeviceArray | None, channels: Channels) -> DeviceArray | None:
        """The background of all channels; None where there is none."""
        if background is None or self.settings.mode == "xray":
            return None
        as_device_array(self.device, background, (channels.color,), name="background")
        if not channels.depth:
            return background
        behind = self.device.zeros((1, channels.total))
        row = background.reshape((1, channels.color))
        copy_columns(self.device, row, 0, behind, 0, channels.color)
        return behind.reshape((channels.total,))

    def _background_grad(self, frame: Frame, grad_image: DeviceArray) -> DeviceArray | None:
        if frame.raster_pass.background is None:
            return None
        height, width, channels = grad_image.shape
        pixels = height * width
        run = _PIXEL_RUN if self.device.traits.is_cpu else 1
        runs = -(-pixels // run)
        seen = self.device.empty((runs, channels))
        self.device.launch(
            "background_grad",
            (runs,),
            grad_image=grad_image,
            transmittance=frame.transmittance,
            parts=seen,
            pixels=pixels,
            CHANNELS=channels,
            RUN=run,
        )
        total, color = sum_columns(self.device, seen), frame.channels.color
        if color == channels:
            return total
        ours = self.device.empty((1, color))
        copy_columns(self.device, total.reshape((1, channels)), 0, ours, 0, color)
        return ours.reshape((color,))


def _on_screen(
    projection: Projection, channels: Channels, depth: DepthKind | None
) -> tuple[ScreenSplats, DeviceArray, DeviceArray, tuple[int, int]]:
    """What the raster is given: splats on the screen, their boxes and depths, and its size."""
    features = gather_features(projection, channels)
    median = depth == "median"
    screen = ScreenSplats(projection.screen, features, projection.modes, median)
    return screen, projection.boxes, projection.depths, projection.camera.size


def _summed(device: Device, table: DeviceArray | None) -> DeviceArray | None:
    """The sum over all splats' parts; None where there are none."""
    return None if table is None else sum_columns(device, table)


def _expected_depth(device: Device, raster: Raster) -> None:
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


def _expected_depth_grad(
    device: Device,
    raster: Raster,
    grad_image: DeviceArray,
    grad_transmittance: DeviceArray | None = None,
) -> tuple[DeviceArray, DeviceArray]:
    """The gradient by the image with accumulated depth, and by the transmittance.

    Args:
        device: where the arrays are.
        raster: after ``_expected_depth``.
        grad_image: (height, width, D) by the image.
        grad_transmittance: (height, width); zero if not given.
    """
    height, width, channels = raster.image.shape
    if grad_transmittance is None:
        grad_transmittance = device.zeros((height, width))
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
