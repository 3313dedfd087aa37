"""A scene as the commands take it: a file of splats, or the folder that a fit left behind.

How wide splats are drawn (eps2d) is part of what was fitted: drawn otherwise, the same splats look
softer or harder. So is what was behind them. The folder of a fit says so, a file does not.
Modes, lobes and activation are in the file, and so are the light that colours are in and whether
splats are antialiased, with the eps2d of that; those of older fits are in the folder alone.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular.environment import blunted
from rift_cl.commands.cameras.fit_cameras import CAMERA_FILES, FitCameras, open_fit_cameras
from rift_cl.commands.inputs.scene_bounds import bounds_of_splats
from rift_cl.commands.run_folder.run_folder import job_of
from rift_cl.commands.run_folder.saved_settings import read_settings
from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.images.display_light import LightKind, to_display, to_linear
from rift_cl.io.images.environment_map import read_environment_map
from rift_cl.io.json_fields import Fields, read_json_object
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.splat.settings import SplatSettings

if TYPE_CHECKING:
    from rift_cl.commands.inputs.scene_input import SceneInput

_SCENE, _CONFIG, _METRICS = "scene.ply", "config.json", "metrics.json"
_OF_FIT = (_CONFIG, *CAMERA_FILES[:1])


class OpenedScene:
    """Splats in host memory, with their rendering settings.

    Args:
        settings: where the scene is.
        densities: whether it may be one of X-rays.

    Raises:
        InputError: there is no scene, a number makes no sense, or the scene is empty.
        FileFormatError: the scene, or what a fit wrote beside it, is damaged.
    """

    def __init__(self, settings: SceneInput, *, densities: bool = False) -> None:
        path = settings.scene
        self.path, self.folder = path, path if path.is_dir() else None
        self.name: str = path.resolve().name
        self.splats = SplatScene.load(scene_file(path))
        if self.splats.mode == "xray" and not densities:
            raise InputError(
                f"{path}: is an X-ray scene, of densities and not of light; its slices lie with "
                "its fit, 'rift view' shows it, and 'rift export --mesh' makes a surface of it"
            )
        if len(self.splats) == 0:
            raise InputError(f"{path}: holds no splats, there is nothing to draw")
        rendering = replace(
            self._rendering(),
            mode=self.splats.mode,
            activation=self.splats.activation,
            angular=self.splats.angular,
        )
        if self.splats.antialiased:
            rendering = replace(rendering, antialiased=True)
        for eps2d in (self.splats.eps2d, settings.eps2d):
            rendering = rendering if eps2d is None else replace(rendering, eps2d=eps2d)
        self.rendering = rendering
        self.light: LightKind = self._light()
        self.splats = self._said()
        if settings.environment is not None:
            self.splats = self._relit(settings.environment)
        # What is behind the splats, in their light; None where neither user nor fit says so.
        self.told_background: NDArray[np.float32] | None = self._background(settings)

    @property
    def background(self) -> NDArray[np.float32]:
        """What is behind the splats, in their light; black where nobody says so."""
        told = self.told_background
        return np.zeros(3, np.float32) if told is None else told

    @property
    def fit(self) -> Path | None:
        """The folder of the fit that the file of a scene lies in; None where it lies in none."""
        folder = self.path.parent
        is_fit = self.path.name == _SCENE and all((folder / name).is_file() for name in _OF_FIT)
        return folder if is_fit else None

    @property
    def downscale(self) -> int:
        """The factor by which the fit made photographs smaller; 1 where there is no fit."""
        factor = self._fitted("downscale")
        return 1 if factor is None else int(factor)

    @property
    def pinhole(self) -> bool:
        """Whether the fit took every lens for a pinhole, so that blur is in the splats."""
        return self._settings is not None and self._settings.flag("pinhole")

    def refined(self, what: str) -> bool:
        """Whether the fit refined "poses" or "exposures"."""
        training = None if self._settings is None else self._settings.values.get("training")
        return isinstance(training, dict) and training.get(f"refine_{what}") is True

    @cached_property
    def cameras(self) -> FitCameras | None:
        """Those that the fit knows; None where there is no fit, or an older version's.

        Raises:
            RiftError: the files that say so are damaged.
        """
        return None if self.folder is None else open_fit_cameras(self.folder)

    def _said(self) -> SplatScene:
        """The splats with all that a file can say of how they are drawn."""
        how = self.rendering
        eps2d = how.eps2d if how.antialiased else self.splats.eps2d
        return replace(self.splats, light=self.light, antialiased=how.antialiased, eps2d=eps2d)

    def _relit(self, picture: Path) -> SplatScene:
        """The splats under another light."""
        own, reflectance = self.splats.environment, self.splats.reflectance
        if own is None or reflectance is None:
            raise InputError(
                f"--environment {picture}: the splats of {self.path} reflect no light that could "
                "be exchanged; fit them with 'rift fit photos --environment shared'"
            )
        light = read_environment_map(picture, len(own), display=self.light == "display")
        blunt = blunted(reflectance.astype(float), len(own), len(light))
        return replace(self.splats, environment=light, reflectance=blunt.astype(np.float32))

    def _rendering(self) -> SplatSettings:
        """How the fit drew its splats; the defaults where there is no fit.

        Of a small scene the near plane is nearer than by default, which might leave out all of it.
        """
        if self._settings is None:
            usual = SplatSettings()
            nearer = usual.for_scene(bounds_of_splats(self.splats).radius)
            return min(usual, nearer, key=lambda settings: settings.near_plane)
        record = self._settings.values.get("rendering", {})
        return read_settings(SplatSettings, record, f"{self._settings.where}: rendering")

    def _fitted(self, name: str) -> float | None:
        """A number among the settings of the fit."""
        return None if self._settings is None else self._settings.number(name)

    @cached_property
    def _settings(self) -> Fields | None:
        """What the fit was told; None where there is no fit."""
        if self.folder is None or not (self.folder / _CONFIG).is_file():
            return None
        config = read_json_object(self.folder / _CONFIG)
        values = config.values.get("settings")
        if not isinstance(values, dict):
            raise FileFormatError(f"{config.where}: holds no settings of a finished fit")
        return Fields(f"{config.where}: settings", values)

    def _light(self) -> LightKind:
        """The light that the splats' colours are in."""
        if self._settings is None or self.splats.light == "linear":
            return self.splats.light
        light = self._settings.text("light")
        if light == "linear":
            return "linear"
        if light in (None, "display"):
            return "display"
        raise FileFormatError(f"{self._settings.where}: 'light' is no light: {light!r}")

    def _background(self, settings: SceneInput) -> NDArray[np.float32] | None:
        """What the user or the fit says is behind the splats, in their light."""
        if settings.background is not None:
            color = np.array(check_color("--background", settings.background), np.float32)
            if self.light == "linear":
                to_linear(color)
            return color
        if self.folder is None or not (self.folder / _METRICS).is_file():
            return None
        metrics = read_json_object(self.folder / _METRICS)
        found = metrics.values.get("background")
        if found is None:
            return None
        if not (isinstance(found, list) and len(found) == 3):
            raise FileFormatError(f"{metrics.where}: 'background' is no red, green and blue")
        return np.array(check_color(f"{metrics.where}: 'background'", tuple(found)), np.float32)


def scene_file(path: Path) -> Path:
    """The file of splats itself: the path, or what a fit left in that folder.

    Raises:
        InputError: it is a folder without one.
    """
    if not path.is_dir():
        return path
    if not (path / _SCENE).is_file():
        job = job_of(path)
        run = f"what 'rift {job}' made, and " if job else ""
        raise InputError(
            f"{path}: holds {run}no {_SCENE}; name a .ply, .spz or .splat file, or a fit"
        )
    return path / _SCENE


def in_display_light(image: NDArray[np.float32], light: LightKind) -> NDArray[np.float32]:
    """A rendered image in display light, 0 to 1."""
    shown = np.clip(image, 0, 1)
    if light == "linear":
        to_display(shown)
    return shown


def check_color(name: str, color: tuple[object, ...]) -> tuple[float, ...]:
    """Three numbers from 0 to 1.

    Raises:
        InputError: they are not.
    """
    values = tuple(float(v) for v in color if isinstance(v, (int, float)) and 0 <= v <= 1)
    if len(values) != 3:
        shown = " ".join(map(str, color))
        raise InputError(f"{name} is {shown}, wanted red, green and blue from 0 to 1")
    return values
