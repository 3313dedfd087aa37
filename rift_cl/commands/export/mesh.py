"""``rift export --mesh``: the surface of a scene as triangles.

In an X-ray scene it is that of one density: the splats are summed on a grid, whose samples are
means over voxels, and the surface is found by marching cubes (Lewiner et al. 2003, scikit-image).
The grid ends in empty voxels, so that the surface is closed; where no density is named, it is the
one that parts the voxels best (Otsu 1979). In a scene of photographs it is where ``FusedDepth``
finds it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.export.axes import check_scale
from rift_cl.commands.export.export import format_name, output_path, write_whole
from rift_cl.commands.export.fused_depth import FusedDepth
from rift_cl.commands.export.settings import ExportSettings
from rift_cl.commands.inputs.opened_scene import scene_file
from rift_cl.errors import InputError
from rift_cl.geometry import Grid
from rift_cl.io.scenes.mesh_files import MESH_FORMATS
from rift_cl.io.scenes.splat_activations import scales_of
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.progress import Report
from rift_cl.splat.voxels import voxelise

# Splats below this share of the strongest density say nothing of where the object is; the others
# reach so many standard deviations.
_FAINT, _REACH = 1e-3, 3.0
_FEWEST, _MOST = 8, 2048
# Pieces of a mesh of photographs with less than this share of the largest one's triangles go.
_FRAGMENT = 0.01
# The axis of rotation, z, is glTF's y.
_UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


class MeshExport:
    """A surface that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scene cannot be read, no camera is known, or the file is there.
    """

    def __init__(self, settings: ExportSettings) -> None:
        self.settings = settings
        self.announce: Callable[[str], None] = lambda sentence: None
        check_scale(settings.scale)
        self._name = format_name(settings, "ply")
        if self._name not in MESH_FORMATS:
            raise InputError(f"--to {self._name} holds no triangles: take ply, stl, obj or glb")
        if not _FEWEST <= settings.voxels <= _MOST:
            raise InputError(f"--voxels is {settings.voxels}, wanted {_FEWEST} to {_MOST}")
        path = scene_file(settings.scene)
        self.scene = SplatScene.load(path)
        if not len(self.scene):
            raise InputError(f"{path}: holds no splats, there is no surface")
        self._depth = None if self.scene.mode == "xray" else FusedDepth(settings)
        if self._depth is None:
            self.grid = _grid(self.scene, settings.voxels)
        self.path = output_path(settings, f".{self._name}")
        self.device = settings.open_device()

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        head = {
            "scene": f"{self.settings.scene}, {len(self.scene)} splats",
            "output": str(self.path),
        }
        if self._depth is not None:
            return {**head, **self._depth.plan(), "device": self.device.name}
        level = self.settings.level
        return {
            **head,
            "voxels": f"{self.grid.shape} (z, y, x), {self.grid.spacing[0]:.4g} wide",
            "density": "that which parts the voxels best" if level is None else f"{level:g}",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report as each step is done.

        Raises:
            InputError: there is no surface.
        """
        if self._depth is not None:
            yield from self._depth.run(self.device)
            self.grid = self._depth.grid
            vertices, triangles = surface(self._depth.inside, self.grid, 0.0, self._depth.seen)
            vertices, whole, dropped = without_fragments(vertices, triangles)
            yield Report(1, 2, "steps: surface")
            if self._depth.doubt:
                self.announce(self._depth.doubt)
            if dropped:
                self.announce(
                    f"{dropped} pieces with less than {_FRAGMENT:.0%} of the largest one's "
                    f"triangles were left out, {len(triangles) - len(whole)} triangles of "
                    f"{len(triangles)}"
                )
            yield self._written(vertices, whole, f"from {len(self._depth.cameras)} depth maps", 2)
            return
        # The variance of a voxel's box along each axis: samples are means over voxels.
        dilation = self.grid.spacing[0] ** 2 / 12
        splats = self.scene.upload(self.device)
        volume = self.device.get(voxelise(self.device, splats, self.grid, dilation=dilation))
        yield Report(1, 3, "steps: voxels")
        level = self._level(volume)
        vertices, triangles = surface(volume, self.grid, level)
        yield Report(2, 3, "steps: surface")
        if self._name == "glb":
            vertices = (vertices @ _UPRIGHT.T).astype(np.float32)
            self.announce("the scene is turned so that the axis of rotation, z, is y")
        yield self._written(vertices, triangles, f"at density {level:.6g}", 3)

    def _written(
        self, vertices: NDArray[np.float32], triangles: NDArray[np.uint32], where: str, steps: int
    ) -> Report:
        vertices = (vertices * np.float64(self.settings.scale)).astype(np.float32)
        content = MESH_FORMATS[self._name](vertices, triangles)
        write_whole(self.path, content)
        self.result = (
            f"{self.path}, {len(triangles)} triangles {where}, {format_bytes(len(content))}"
        )
        return Report(steps, steps, "steps: file")

    def _level(self, volume: NDArray[np.float32]) -> float:
        from skimage.filters import threshold_otsu

        low, high = float(volume.min()), float(volume.max())
        level = self.settings.level
        if level is None:
            level = float(threshold_otsu(volume)) if low < high else low
        if not max(low, 0) < level < high:
            raise InputError(
                f"--level is {level:g}, but densities go from {low:.4g} to {high:.4g}: there is no "
                "surface"
            )
        return level


def surface(
    volume: NDArray[np.float32], grid: Grid, level: float, known: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """(V, 3) places (x, y, z) of a density's surface, and (T, 3) triangles of them.

    The corners of a triangle go counter-clockwise as they are seen from where the density is less.

    Args:
        volume: (z, y, x) densities.
        grid: where they are.
        level: less than the greatest.
        known: (z, y, x) the voxels beside which there may be a surface; all, and the empty ones
            around the grid, when not given.

    Raises:
        InputError: there is no surface.
    """
    from skimage.measure import marching_cubes

    padded = np.pad(volume, 1, constant_values=0.0 if level > 0 else level - 1)
    if not padded.min() < level < padded.max():
        raise InputError("there is no surface: all voxels are on one side of it")
    vertices, triangles, _, _ = marching_cubes(padded, level)
    if known is not None:
        # A vertex lies between two voxels, and the surface between what is known alone.
        ends = [np.floor(vertices).astype(int), np.ceil(vertices).astype(int)]
        sure = np.pad(known, 1)
        kept = np.logical_and(*(sure[tuple(end.T)] for end in ends))
        triangles = triangles[kept[triangles].all(axis=1)]
        if not len(triangles):
            raise InputError("there is no surface between voxels that cameras know")
        used, triangles = np.unique(triangles, return_inverse=True)
        vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    first = [grid.coordinates(axis)[0] - grid.spacing[axis] for axis in range(3)]
    # In (z, y, x) its triangles are seen clockwise; (x, y, z) is a reflection of that.
    places = (vertices * grid.spacing + first)[:, ::-1]
    return np.ascontiguousarray(places, np.float32), triangles.astype(np.uint32)


def without_fragments(
    vertices: NDArray[np.float32], triangles: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], NDArray[np.uint32], int]:
    """A mesh without its small pieces, such as splats leave that float before a surface.

    Args:
        vertices: (V, 3).
        triangles: (T, 3), one or more.

    Returns:
        The vertices and the triangles of pieces with a hundredth of the largest one's triangles or
        more, and how many pieces were left out.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = triangles[:, [0, 1, 1, 2]].reshape(-1, 2).T.astype(np.int64)
    joined = coo_array((np.ones(ends.shape[1], bool), tuple(ends)), shape=(len(vertices),) * 2)
    count, of_vertex = connected_components(joined, directed=False)
    of_triangle = of_vertex[triangles[:, 0]]
    sizes = np.bincount(of_triangle, minlength=count)
    large = sizes >= _FRAGMENT * sizes.max()
    kept = triangles[large[of_triangle]]
    used, kept = np.unique(kept, return_inverse=True)
    return vertices[used], kept.reshape(-1, 3).astype(np.uint32), int(count - large.sum())


def _grid(scene: SplatScene, voxels: int) -> Grid:
    """Grid over the box of all splats that are not faint, by voxels along its longest edge."""
    densities = scene.logit_opacities.astype(np.float64)
    strong = densities >= densities.max() + np.log(_FAINT)
    reach = _REACH * scales_of(scene.log_scales[strong]).max(axis=1, keepdims=True)
    means = scene.means[strong].astype(np.float64)
    low, high = (means - reach).min(axis=0), (means + reach).max(axis=0)
    spacing = float((high - low).max()) / voxels
    if not 0 < spacing < np.inf:
        raise InputError("the splats of the scene have no size, there is no surface")
    shape = np.maximum(np.ceil((high - low) / spacing), 1).astype(int)[::-1]
    return Grid(shape.tolist(), spacing, ((low + high) / 2)[::-1].tolist())
