"""Splats on the host, as files hold them: before the activations that a rasterizer needs.

A trainer works on logarithms of scales and logits of opacities, and its files keep them, so that
a scene that was saved and loaded is the same to the bit. ``upload`` makes what is drawn of it.

Splats of X-rays have densities in the place of opacities. They are a scene of another kind, and a
property of another name in the file, so that no viewer takes the one for the other.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_host_array, as_real_array, check_finite
from rift_cl.errors import FileFormatError, InputError, OutputError, ShapeError
from rift_cl.io.boundary import reading
from rift_cl.io.images.display_light import LightKind
from rift_cl.io.output import atomic_path, check_space
from rift_cl.io.scenes.doubted_splats import doubt_activations
from rift_cl.io.scenes.scene_drawing import SceneDrawing
from rift_cl.io.scenes.splat_activations import (
    check_range,
    drawn_strengths,
    kept_strengths,
    log_scales_of,
    scales_of,
)
from rift_cl.io.scenes.splat_basis import SceneBasis
from rift_cl.io.scenes.splat_file import encode_splat, read_splat
from rift_cl.io.scenes.splat_ply import COEFFICIENTS, encode_ply, read_ply, scene_shapes
from rift_cl.io.scenes.spz_file import read_spz
from rift_cl.io.scenes.whole_splats import whole_splats
from rift_cl.splat.rounded_places import check_rounding, distances_moved
from rift_cl.splat.settings import Activation, SplatMode
from rift_cl.splat.splats import Splats

_ENCODERS = {".ply": encode_ply, ".splat": encode_splat}
# What splats reflect light with: all of it, or nothing.
_LIGHT = ("normals", "reflectance", "environment")
_PLY_STARTS = (b"ply\n", b"ply\r")


@dataclass(frozen=True, eq=False)
class SplatScene:
    """N splats in host memory; arrays of any real type become float32, float32 is not copied.

    Args:
        means: (N, 3) positions in world coordinates.
        log_scales: (N, 3) logarithms of the standard deviations along the rotated axes.
        quats: (N, 4) rotations as quaternions (w, x, y, z) of any length.
        logit_opacities: (N,) logits of the opacities.
        sh: (N, K, 3) coefficients of spherical harmonics, K = 1, 4, 9, 16 or 25; of lobes, where
            there are some, any K up to 36.
        shape_modes: (N, K - 1) Hermite modes of the shape, or None; see ``rift_cl.splat.splats``.
        color_modes: (N, K - 1, 3) those of the colour, or None.
        lobes: (N, G) geometry of the lobes that colours vary in, or None.
        normals: (N, 3) normals of splats that reflect an environment light, or None; see
            ``rift_cl.splat.splats``.
        reflectance: (N, 7) how they reflect it, or None.
        environment: (K, 3) natural logarithms of the radiance of that light's lobes, or None.
        activation: that densities are drawn with; see ``SplatSettings``.
        angular: what colours vary in; see ``SplatSettings``.
        light: that colours are in: ``display`` or ``linear``.
        antialiased: whether splats are dimmed as ``eps2d`` widens them; see ``SplatSettings``.
        eps2d: that they are to be drawn with, in square pixels of what they were fitted to; None
            where that is not known.

    Raises:
        ShapeError: an array does not fit the others.
        DTypeError: an array does not hold real numbers.
        NonFiniteError: an array holds NaN or infinity.
        InputError: a choice is unknown, or not for scenes of this mode; or ``means`` are float64
            and so far from the origin that float32 moves splats by more than a tenth of a width.
    """

    means: NDArray[np.float32]
    log_scales: NDArray[np.float32]
    quats: NDArray[np.float32]
    logit_opacities: NDArray[np.float32]
    sh: NDArray[np.float32]
    shape_modes: NDArray[np.float32] | None = None
    color_modes: NDArray[np.float32] | None = None
    lobes: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    reflectance: NDArray[np.float32] | None = None
    environment: NDArray[np.float32] | None = None
    activation: Activation = "clamp"
    angular: str = "sh"
    light: LightKind = "display"
    antialiased: bool = False
    eps2d: float | None = None
    mode: ClassVar[SplatMode] = "light"

    def __post_init__(self) -> None:
        """Bring the arrays into their normal form and check that they fit each other."""
        means, sh = (
            as_real_array(getattr(self, n), name=f"SplatScene: {n}") for n in ("means", "sh")
        )
        count, basis = means.shape[0] if means.ndim else 0, SceneBasis.of(self)
        for name, value in vars(SceneDrawing.of(self)).items():
            object.__setattr__(self, name, value)
        lobed = self.angular != "sh"
        if sh.ndim != 3 or not (lobed or sh.shape[1] in COEFFICIENTS):
            words = "K of the lobes" if lobed else "K = 1, 4, 9, 16 or 25"
            raise ShapeError(
                f"SplatScene: sh has shape {sh.shape}, wanted ({count}, K, 3) with {words}"
            )
        if lobed != (self.lobes is not None):
            raise ShapeError(
                f"SplatScene: angular is {self.angular!r} {'without' if lobed else 'with'} lobes, "
                "wanted both, or harmonics ('sh') and none"
            )
        lit = [name for name in _LIGHT if getattr(self, name) is not None]
        if lit and len(lit) < len(_LIGHT):
            raise ShapeError(
                f"SplatScene: {' and '.join(lit)} without the rest, wanted all of "
                f"{', '.join(_LIGHT)} or none"
            )
        for name, shape in scene_shapes(count, sh.shape[1], basis).items():
            array = as_host_array(
                getattr(self, name), shape, name=f"SplatScene: {name}", wants="the scene"
            )
            object.__setattr__(self, name, array)
        if means.dtype == np.float64:
            moved = distances_moved(means, self.means)
            check_rounding("SplatScene: means", moved, self.means, self.log_scales)

    def __repr__(self) -> str:
        """How many splats there are, and what they are made of."""
        more = [name for name in ("shape_modes", "color_modes") if getattr(self, name) is not None]
        facts = [f"{len(self)} splats", f"{self.sh.shape[1]} x {self.angular}", *more]
        return f"<{type(self).__name__}: {', '.join(facts)}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: a picture, and what the splats are."""
        html: str = import_module("rift_cl.commands.pictures.scene_card").scene_card(self)
        return html

    def __len__(self) -> int:
        """Number of splats."""
        return len(self.means)

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 4; 0 where lobes are in their place."""
        return 0 if self.lobes is not None else COEFFICIENTS.index(self.sh.shape[1])

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, budget: int | None = None) -> SplatScene:
        """Read a .ply file of 3D Gaussian splatting, whatever its name is, an .spz or a .splat.

        A PLY file may be text or binary of either byte order, with its properties in any order,
        of any scalar type, and with others between them or elements beside them, which are left
        out. The other formats are known by their names; an .spz file is read in its own axes, y
        up. Splats that cannot be drawn, since a number of theirs is NaN or infinite, are left out,
        and a warning counts them. Another warning tells of scales and opacities that seem to be
        stored as they are.

        Args:
            path: the file.
            budget: bytes that the splats may take; 60 % of the free memory when not given.

        Returns:
            An ``XrayScene`` where the file holds densities.

        Raises:
            InputError: there is no such file.
            FileFormatError: the file is damaged, or holds no splats, or places in more digits than
                float32 has, so that splats would be moved by more than a tenth of their width.
            NonFiniteError: more than half of the splats cannot be drawn, or the light holds NaN.
            ResourceLimitError: the splats are larger than the budget; nothing was allocated.
        """
        path = Path(path)
        with reading(path, "the scene"):
            mode, basis, drawing, arrays = _read(path, budget=budget)
        if basis.environment:
            check_finite(arrays["environment"], name=f"{path}: environment")
        whole: dict[str, Any] = whole_splats(path, mode, arrays)
        if mode == "light":
            doubt_activations(path, whole)
        kind: type[SplatScene] = XrayScene if mode == "xray" else SplatScene
        return kind(**whole, activation=basis.activation, angular=basis.angular, **vars(drawing))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file that appears complete or not at all.

        Args:
            path: ends in .ply, which keeps every bit, or in .splat: 32 bytes for each splat, with
                rounded opacities, rotations and colours, and without the higher harmonics.

        Raises:
            InputError: the ending is another, or a .splat file cannot hold the scene: one that is
                empty, or of X-rays, or has modes, lobes, an environment light, an activation or
                linear light, or is antialiased.
            OutputError: the file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() not in _ENCODERS:
            raise InputError(f"{path}: splats are written as .ply or .splat: end the name so")
        if self.mode == "xray" and path.suffix.lower() == ".splat":
            raise InputError(f"{path}: a .splat file holds opacities, not densities: save a .ply")
        basis = SceneBasis.of(self)
        if path.suffix.lower() == ".splat" and not basis.plain:
            raise InputError(f"{path}: a .splat file holds no {basis.named}: save a .ply")
        drawing = SceneDrawing.of(self)
        if path.suffix.lower() == ".splat" and not drawing.usual:
            raise InputError(f"{path}: a .splat file cannot say {drawing.words!r}: save a .ply")
        size, blocks = _ENCODERS[path.suffix.lower()](self)
        check_space(path, size)
        with atomic_path(path) as part:
            with part.open("wb") as file:
                for block in blocks:
                    file.write(block)
            if part.stat().st_size != size:
                raise OutputError(f"{path}: is shorter than its splats; the disk lost some")

    def upload(self, device: Device) -> Splats:
        """Copy what is drawn to a device: scales, opacities, and the rest as it is."""
        return Splats.upload(
            device,
            means=self.means,
            quats=self.quats,
            scales=scales_of(self.log_scales),
            opacities=drawn_strengths(self.logit_opacities, self.mode, self.activation),
            sh=self.sh,
            shape_modes=self.shape_modes,
            color_modes=self.color_modes,
            lobes=self.lobes,
            **{name: getattr(self, name) for name in _LIGHT},
        )

    @classmethod
    def of(
        cls,
        splats: Splats,
        device: Device,
        *,
        activation: Activation = "clamp",
        angular: str = "sh",
        drawing: SceneDrawing | None = None,
    ) -> SplatScene:
        """Copy splats back from a device.

        A scale of 0 and opacities of 0 and 1, whose logarithms and logits are not finite, become
        the float32 numbers nearest to them.

        Args:
            splats: with rotations, scales and coefficients of colours.
            device: where they are.
            activation: that they are drawn with.
            angular: what their colours vary in.
            drawing: the light that their colours are in, and how they are dimmed; display light
                and not at all when not given.

        Raises:
            InputError: the splats have covariances, own colours or no harmonics, or a scale or
                an opacity that no file can hold.
            NonFiniteError: an array holds NaN, or positions, rotations or harmonics infinity.
        """
        if (
            splats.scales is None
            or splats.quats is None
            or splats.sh is None
            or splats.colors is not None
        ):
            raise InputError("SplatScene: wants splats with quats, scales and sh, and no colors")
        scales = device.get(splats.scales)
        check_range("scales", scales, np.inf)
        names = ("shape_modes", "color_modes", "lobes", *_LIGHT)
        found = {name: getattr(splats, name) for name in names}
        more: dict[str, Any] = {
            name: None if array is None else device.get(array) for name, array in found.items()
        }
        return cls(
            means=device.get(splats.means),
            log_scales=log_scales_of(scales),
            quats=device.get(splats.quats),
            logit_opacities=kept_strengths(device.get(splats.opacities), cls.mode, activation),
            sh=device.get(splats.sh),
            **more,
            activation=activation,
            angular=angular,
            **vars(drawing or SceneDrawing()),
        )


class XrayScene(SplatScene):
    """Splats of an X-ray scan; see ``SplatScene``.

    ``logit_opacities`` are natural logarithms of the densities at the splats' peaks, per length;
    they are drawn with ``SplatSettings(mode="xray")``.
    """

    mode: ClassVar[SplatMode] = "xray"


def _read(
    path: Path, *, budget: int | None
) -> tuple[SplatMode, SceneBasis, SceneDrawing, dict[str, NDArray[np.float32]]]:
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file")
    with path.open("rb") as file:
        start = file.read(4)
        file.seek(0)
        if start in _PLY_STARTS:
            return read_ply(path, file, budget=budget)
        if path.suffix.lower() == ".splat":
            arrays = read_splat(path, file, budget=budget)
            return "light", SceneBasis(), SceneDrawing(), arrays
        if path.suffix.lower() == ".spz":
            drawing, arrays = read_spz(path, file, budget=budget)
            return "light", SceneBasis(), drawing, arrays
    raise FileFormatError(
        f"{path}: is no PLY file, and no .spz or .splat file by its name{_way_out(path, start)}"
    )


def _way_out(path: Path, start: bytes) -> str:
    """What can be done with a file of another format, by its first bytes or its name."""
    if start == b"glTF" or path.suffix.lower() in (".glb", ".gltf"):
        return (
            "; splats in glTF are written here and not read: export what they were made of "
            "('rift export SCENE --to ply')"
        )
    if start == b"PK\x03\x04" or path.suffix.lower() in (".sog", ".ksplat"):
        return (
            "; SOG and other compressed splats are not read: convert them by "
            "'npx @playcanvas/splat-transform IN OUT.ply'"
        )
    if start.startswith(b"\x1f\x8b"):
        return "; it is a gzip stream: end its name in .spz where it is SPZ"
    return ""
