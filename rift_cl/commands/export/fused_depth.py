"""The surface of a scene of photographs, from the depth of its splats as its cameras see them.

Opacities are no densities, so that no level of theirs is the surface. But each camera sees how far
off it is: rendered depths are fused into a truncated signed distance on a grid (Curless and Levoy,
SIGGRAPH 1996), positive inside, and the surface is where that is 0. A voxel that no camera sees, or
only behind a surface, is unknown, and there is no surface beside it: where nobody looked the mesh
is open.

Splats are fog before and behind a surface. The median depth, at which half of the light is gone,
lies nearer to it than the mean does; and where cameras disagree, the distance is truncated at a
multiple of what they disagree by, since with a shorter reach each would lay a shell of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from rift_cl.cl.budget import format_bytes, host_budget
from rift_cl.cl.device import Device
from rift_cl.commands.export.settings import ExportSettings
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.pictures.depth_picture import depth_and_alpha
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.pictures.small_looks import small_looks
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.geometry import Camera, Grid
from rift_cl.io.captures.capture import View, camera_at, open_capture
from rift_cl.progress import Report
from rift_cl.splat.renderer import Renderer

# Cameras that are asked, evenly chosen; alpha above which a pixel shows a surface.
_CAMERAS, _SOLID = 64, 0.5
# Voxels over which the distance falls from 1 to 0 before the surface, at least; and how many times
# what cameras disagree by, but no more than this share of the shortest edge of what is seen. With
# fewer times they lay shells of their own, with more they swell what is thin.
_REACH, _TIMES, _WIDEST = 4.0, 16.0, 0.25
# Pixels of the longer edge of the depths that others are compared with, and places of each camera.
_COMPARED, _FEW_PLACES = 1024, 2000
# Voxels along each axis beyond what cameras see.
_MARGIN = 10
# Voxels along the longest edge at least: between opposite sides of what is seen the distances of
# both have their whole reach.
_FEWEST = int(_MARGIN + 2 * _REACH)
# Share of a voxel that is rounding.
_ROUNDING = 1e-6
# Pixels of each camera by which the grid is laid, at most, and bytes that a voxel takes at most.
_PLACES, _BYTES = 20_000, 24
# Share of the places that cameras see which lies beyond each side of the grid.
_BEYOND = 0.005

Depth = NDArray[np.float32]
Values = NDArray[np.float32]
Mask = NDArray[np.bool_]


class FusedDepth:
    """Depths of a scene of photographs, to be fused.

    Args:
        settings: the scene, its cameras, and how fine the grid is.

    Raises:
        RiftError: the scene cannot be read, no camera is known, or a setting is about densities.
    """

    def __init__(self, settings: ExportSettings) -> None:
        if settings.level is not None:
            raise InputError(
                "--level is a density, which scenes of photographs have not: leave it out"
            )
        if settings.voxels < _FEWEST:
            raise InputError(
                f"--voxels is {settings.voxels}, wanted {_FEWEST} or more of a scene of "
                f"photographs: {_MARGIN} of them lie beyond what its cameras see"
            )
        self._scene = OpenedScene(settings)
        self._voxels = settings.voxels
        self.cameras = chosen_cameras(self._known(settings), self._scene.downscale)
        if not self.cameras:
            raise InputError(f"{settings.scene}: none of its cameras is a pinhole, as --mesh wants")

    def _known(self, settings: ExportSettings) -> Sequence[View]:
        if settings.capture is not None:
            return open_capture(settings.capture, photographs=False).views
        if self._scene.cameras is None:
            raise InputError(
                f"{settings.scene} holds no cameras, from which --mesh looks at a scene of "
                "photographs: name the folder of the fit, or a capture with --capture"
            )
        return self._scene.cameras.views

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        return {
            "depths": f"{len(self.cameras)} cameras",
            "voxels": f"{self._voxels} along the longest edge",
        }

    def run(self, device: Device) -> Iterator[Report]:
        """Fuse; a report after each camera. Then ``grid``, ``inside`` and ``seen`` are there.

        Depths are drawn twice, once to lay the grid and once to fuse them, so that none is kept.

        Raises:
            InputError: no camera sees a surface.
            ResourceLimitError: the grid does not fit the free memory.
        """
        renderer = Renderer(self._scene.rendering, device=device)
        splats = self._scene.splats.upload(device)

        def depth_of(camera: Camera) -> Depth:
            depth, alpha = depth_and_alpha(renderer, splats, camera, "median")
            return np.where((alpha > _SOLID) & (depth > 0), depth, np.float32(np.inf))

        places, count = [], len(self.cameras)
        for number, camera in enumerate(self.cameras):
            places.append(places_of(camera, depth_of(camera)))
            yield Report(number + 1, 2 * count, "depths")
        self.grid = grid_of(np.concatenate(places), self._voxels)
        _check_memory(self.grid, self._voxels)
        looks = [(camera, depth_of(camera)) for camera in small_looks(self.cameras, _COMPARED)]
        self.disagreement = disagreement(looks, places)
        self.reach = reach_of(self.disagreement, self.grid)
        volume = Distances(self.grid, self.reach)
        for number, camera in enumerate(self.cameras):
            volume.add(camera, depth_of(camera))
            yield Report(count + number + 1, 2 * count, "depths")
        self.inside, self.seen = volume.inside(), volume.seen()

    @property
    def doubt(self) -> str | None:
        """What is to be said of depths that disagree; None where they agree within voxels."""
        if self.reach <= _REACH * self.grid.spacing[0] * (1 + _ROUNDING):
            return None
        return (
            f"the cameras' depths disagree by {self.disagreement:.3g} (median), and the mesh is a "
            f"mean of them: what is thinner than {self.reach:.3g} may be swollen, and the surface "
            "is rougher than it should be; fewer --voxels smooth it, and fits of more steps, or "
            "with 'rift fit photos --preset surface', agree better"
        )


def chosen_cameras(views: Sequence[View], downscale: int) -> list[Camera]:
    """Pinholes, evenly chosen among views, without apertures, at the size of a fit's photographs.

    Args:
        views: at the photographs' own size.
        downscale: the factor by which the fit made them smaller.
    """
    pinholes = [view for view in views if view.camera.model == "pinhole"]
    if not pinholes:
        return []
    chosen = [pinholes[place] for place in evenly(len(pinholes), _CAMERAS)]
    small = [camera_at(view, min(downscale, *view.camera.size)) for view in chosen]
    return [Camera(camera.size, camera.K, camera.view) for camera in small]


def _check_memory(grid: Grid, voxels: int) -> None:
    need, free = _BYTES * math.prod(grid.shape), host_budget()
    if need > free:
        raise ResourceLimitError(
            f"--voxels {voxels} makes a grid of {grid.shape}, which takes {format_bytes(need)}; "
            f"{format_bytes(free)} may be taken: ask for fewer voxels"
        )


def grid_of(places: NDArray[np.float64], voxels: int) -> Grid:
    """The grid over what cameras see, by voxels along its longest edge.

    Args:
        places: (n, 3) of the surface, of all cameras.
        voxels: how many, more than those of the margin.

    Raises:
        InputError: nothing is seen.
    """
    if not len(places):
        raise InputError("no camera sees a surface: everywhere alpha is below a half")
    low, high = np.quantile(places, (_BEYOND, 1 - _BEYOND), axis=0)
    spacing = float((high - low).max()) / (voxels - _MARGIN)
    if not spacing > 0:
        raise InputError("what the cameras see is a single point: there is no surface")
    shape = np.ceil((high - low) / spacing - _ROUNDING + _MARGIN).astype(int)[::-1]
    return Grid(shape.tolist(), spacing, ((low + high) / 2)[::-1].tolist())


def places_of(camera: Camera, depth: Depth) -> NDArray[np.float64]:
    """Places (n, 3) of the surface that a camera sees, of evenly chosen pixels.

    Args:
        camera: a pinhole.
        depth: (height, width) along its axis; infinity where nothing is seen.
    """
    fx, fy, cx, cy = camera.intrinsics
    seen_at = np.flatnonzero(np.isfinite(depth))
    if len(seen_at):
        seen_at = seen_at[evenly(len(seen_at), _PLACES)]
    y, x = np.unravel_index(seen_at, depth.shape)
    z = depth[y, x].astype(np.float64)
    seen = np.stack([(x + 0.5 - cx) / fx * z, (y + 0.5 - cy) / fy * z, z], axis=1)
    return np.asarray((seen - camera.view[:3, 3]) @ camera.view[:3, :3])


def disagreement(
    looks: Sequence[tuple[Camera, Depth]], places: Sequence[NDArray[np.float64]]
) -> float:
    """The median of how far places that others see lie before a camera's surface.

    What lies behind its surface may be hidden from it; but what lies before would hide it. It has
    to lie before what the pixels beside show as well, since surfaces are slanted and have edges.

    Args:
        looks: some of the cameras, and what each sees: (height, width) along its axis, infinity
            where there is no surface.
        places: (n, 3) of the surface, of each camera.
    """
    few = np.concatenate([seen[evenly(len(seen), _FEW_PLACES)] for seen in places if len(seen)])
    before = []
    for camera, depth in looks:
        away = few @ camera.view[:3, :3].T + camera.view[:3, 3]
        on, rows, columns = pixels_of(camera, away)
        apart = minimum_filter(depth, 3)[rows, columns][on] - away[on, 2]
        # A camera's own places lie where it sees them, but for rounding.
        before.append(apart[np.isfinite(apart) & (apart > _ROUNDING * away[on, 2])])
    found = np.concatenate(before)
    return float(np.median(found)) if len(found) else 0.0


def reach_of(disagreement: float, grid: Grid) -> float:
    """The length over which the distance falls from 1 to 0 before the surface.

    Args:
        disagreement: of the cameras, see ``disagreement``.
        grid: over what they see.
    """
    shortest = (min(grid.shape) - _MARGIN) * grid.spacing[0]
    return max(_REACH * grid.spacing[0], min(_TIMES * disagreement, _WIDEST * shortest))


def pixels_of(
    camera: Camera, places: NDArray[np.float64]
) -> tuple[Mask, NDArray[np.intp], NDArray[np.intp]]:
    """Whether a pinhole sees places (..., 3) in its axes, and in which row and column."""
    fx, fy, cx, cy = camera.intrinsics
    away = places[..., 2]
    ahead = away > 0
    safe = np.where(ahead, away, 1)
    u, v = fx * places[..., 0] / safe + cx, fy * places[..., 1] / safe + cy
    inside = ahead & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    columns, rows = (np.where(inside, at, 0).astype(np.intp) for at in (u, v))
    return inside, rows, columns


class Distances:
    """A truncated signed distance on a grid, as a mean over the cameras that know it.

    Args:
        grid: of the voxels.
        reach: the length over which it falls from 1 to 0 before the surface; four voxels when not
            given.
    """

    def __init__(self, grid: Grid, reach: float | None = None) -> None:
        self.grid = grid
        self._reach = _REACH * grid.spacing[0] if reach is None else reach
        self._sum = np.zeros(grid.shape, np.float32)
        self._count = np.zeros(grid.shape, np.float32)

    def add(self, camera: Camera, depth: Depth) -> None:
        """What a camera sees; voxels far behind its surface it does not know.

        Args:
            camera: a pinhole.
            depth: (height, width) along its axis; infinity where there is no surface.
        """
        z, y, x = (self.grid.coordinates(axis) for axis in range(3))
        turn, shift = camera.view[:3, :3], camera.view[:3, 3]
        plane = y[:, None, None] * turn[:, 1] + x[:, None] * turn[:, 0] + shift
        for number, height in enumerate(z.tolist()):
            distance, known = self._of_slice(plane + height * turn[:, 2], camera, depth)
            self._sum[number] += np.where(known, distance, 0)
            self._count[number] += known

    def _of_slice(
        self, places: NDArray[np.float64], camera: Camera, depth: Depth
    ) -> tuple[Values, Mask]:
        """Distances of voxels (rows, columns, 3) in the camera's axes, and where they are known."""
        inside, rows, columns = pixels_of(camera, places)
        distance = (depth[rows, columns] - places[..., 2]) / self._reach
        return np.minimum(distance, 1).astype(np.float32), inside & (distance > -1)

    def seen(self) -> Mask:
        """(z, y, x) the voxels that a camera knows."""
        return np.asarray(self._count > 0)

    def inside(self) -> Values:
        """(z, y, x) distances from the surface over their reach, positive inside; -1 if unknown."""
        mean = self._sum / np.maximum(self._count, 1)
        return np.where(self._count > 0, -mean, np.float32(-1))
