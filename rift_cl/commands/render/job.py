"""``rift render``: frames of a film, or the views of a capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import format_bytes
from rift_cl.commands.cameras.camera_path import in_film_order, opened, resized, smooth_path
from rift_cl.commands.cameras.film_path import (
    capture_arc,
    farthest_from_cameras,
    film,
    frame_of,
    orbit_place,
)
from rift_cl.commands.cameras.pose_check import check_sight, unseen_notes
from rift_cl.commands.cameras.subject import subject_of
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.inputs.scene_depth import depth_maps
from rift_cl.commands.options import absolute_paths
from rift_cl.commands.pictures.depth_picture import LEAST_ALPHA, depth_picture, depth_window
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.pictures.normal_picture import NormalPictures, normal_picture
from rift_cl.commands.render.animation import chosen_film, shrunk
from rift_cl.commands.render.report import Sheet, render_page, write_bytes
from rift_cl.commands.render.settings import LIMITS, MOST_FRAMES, RenderSettings
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import INSTALL, InputError
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import Capture, View, open_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.film_file import film_writer, films_can_be_written, suffix_of
from rift_cl.io.images.image import read_image, write_png
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.output import atomic_path, make_folder, write_json
from rift_cl.progress import Report
from rift_cl.splat.bands import FrameMemory
from rift_cl.splat.renderer import DepthKind, Renderer

# What an earlier rendering leaves.
_LEFT = ("frames", "depth", "normals", "*.png", "transforms.json", "key_frames.json", "film.*")
# Frames of a film when nothing is said, and those that it is made again from.
_FRAMES, _KEYS = 96, 13
# Longer edge of the animation in pixels.
_MOVING = 360


class Render:
    """A rendering that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: the scene or the capture cannot be read, or a setting makes no sense.
    """

    def __init__(self, settings: RenderSettings) -> None:
        settings.check()
        self.settings = settings
        self.scene = settings.open_scene()
        self.bounds = settings.bounds(self.scene)
        self.device = settings.open_device()
        # What is to be said of --path, and how many frames show no splat.
        self._path_notes: tuple[str, ...] = ()
        self._unseen = 0
        cameras = self._path() if settings.path is not None else self._film()
        self.cameras = [
            opened(camera, settings.aperture, settings.focus, self.bounds.center)
            for camera in cameras
        ]
        lenses = [camera.aperture for camera in self.cameras if camera.aperture is not None]
        if settings.focus is not None and not lenses:
            raise InputError("--focus needs a lens with an aperture: give --aperture as well")
        self._kind = chosen_film(settings.film, [camera.size for camera in self.cameras])
        self.folder = RunFolder.of(settings, "render")
        for name, read in (("path", settings.path), ("capture", settings.capture)):
            if read is not None:
                self.folder.check_kept(name, read, *_LEFT)
        self.metrics: dict[str, Any] = {}
        # A small copy of the film, for reports; None where nothing moves, or before it was drawn.
        self.moving: bytes | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions, a sentence each."""
        named = self.settings.path is not None
        notes = self._path_notes if named else self.settings.notes(self.scene)
        notes = (*notes, *unseen_notes(self._unseen, len(self.cameras)))
        if self.settings.film != "auto" or self._kind != "apng" or films_can_be_written():
            return notes
        return (
            *notes,
            "The film is an animated PNG, for PyAV is not installed, with which it would be a "
            f"smaller WebM: {INSTALL} in the folder of the repository, or pip install av.",
        )

    @property
    def decided(self) -> RenderSettings:
        """The settings with a value for what was left open and is one number for all frames.

        Elevation and distance stay open along a path of photographs, where they change.
        """
        settings = self.settings
        decided: dict[str, Any] = {
            "eps2d": self.scene.rendering.eps2d,
            "film": self._kind or "auto",
        }
        if self.scene.light == "display":
            decided["background"] = tuple(float(value) for value in self.scene.background)
        if settings.path is None:
            size, fov = self._frame
            decided |= {
                "frames": len(self.cameras),
                "size": size[::-1],
                "fov": fov,
                "aperture": settings.aperture or 0.0,
            }
            arc = capture_arc(self.bounds)
            if arc is None or arc.closed:
                elevation, distance = orbit_place(
                    self.bounds, *self._frame, settings.elevation, settings.distance
                )
                low, high = LIMITS["elevation"]
                decided |= {"distance": distance}
                # A steeper orbit of a capture's own cameras cannot be asked for by number.
                decided |= {"elevation": elevation} if low <= elevation <= high else {}
        return replace(absolute_paths(settings), **decided)

    @property
    def film(self) -> str | None:
        """The name of the film's file; None where nothing moves."""
        if self._kind is None or self._kind == "apng":
            return self._kind and "animation.png"
        return f"film{suffix_of(self._kind)}"

    def _film_file(self) -> AbstractContextManager[Callable[[NDArray[np.uint8]], object]]:
        """What takes the frames of a film that is written as they come."""
        if self._kind is None or self._kind == "apng":
            return nullcontext(lambda _: None)
        path = self.settings.out / str(self.film)
        return film_writer(path, self._kind, self.cameras[0].size, self.settings.rate)

    def _film(self) -> list[Camera]:
        """Cameras round the scene or along its capture; what is not set comes from there."""
        settings, (size, fov) = self.settings, self._frame
        return film(
            self.bounds,
            frames=settings.frames or _FRAMES,
            size=size,
            fov=fov,
            elevation=settings.elevation,
            distance=settings.distance,
            subject=self.subject,
        )

    @cached_property
    def _frame(self) -> tuple[tuple[int, int], float]:
        """(height, width) of a film's frames, and their vertical field of view in degrees."""
        asked = self.settings.size
        return frame_of(self.bounds, asked and (asked[1], asked[0]), self.settings.fov)

    @cached_property
    def subject(self) -> NDArray[np.float64] | None:
        """What a capture from one side is of, (3,); None for others."""
        arc = capture_arc(self.bounds)
        if arc is None or arc.closed or not arc.inward:
            return None
        return subject_of(depth_maps(self.scene, self.bounds.cameras, self.device))

    def _path(self) -> list[Camera]:
        settings = self.settings
        capture = self._named()
        views = in_film_order(capture)
        cameras = [view.camera for view in views]
        check_sight(cameras, capture.points, Path(settings.path or ""))
        self._path_notes = (*capture.notes, *_lens_notes(views))
        if settings.size is not None:
            cameras = [resized(camera, settings.size[::-1]) for camera in cameras]
        if len(cameras) + settings.between * (len(cameras) - 1) > MOST_FRAMES:
            raise InputError(f"--between {settings.between} makes more than {MOST_FRAMES} frames")
        return smooth_path(cameras, settings.between) if settings.between else cameras

    def _named(self) -> Capture:
        """The capture whose views are drawn; its photographs need not be there."""
        return open_capture(Path(self.settings.path or ""), photographs=False)

    def _way(self) -> str:
        """The film's camera path, in words."""
        arc, bounds = capture_arc(self.bounds), self.bounds
        if self.settings.path is not None:
            return str(self.settings.path)
        if arc is None or arc.closed:
            return f"orbit at {np.linalg.norm(self.cameras[0].center - bounds.center):.4g}"
        farthest = farthest_from_cameras(self.cameras, bounds)
        return f"there and back along the photographs, at most {farthest:.0f} degrees from one"

    def plan(self) -> dict[str, str]:
        """What would be done, by name."""
        bounds, scene = self.bounds, self.scene.splats
        largest = max((camera.size for camera in self.cameras), key=lambda size: size[0] * size[1])
        channels = 3 + self.settings.depth
        memory = FrameMemory.of(scene, largest, channels, self.scene.rendering)
        return {
            "scene": f"{self.scene.name}, {len(scene)} splats",
            "middle": "({:.4g}, {:.4g}, {:.4g})".format(*bounds.center),
            "radius": f"{bounds.radius:.4g}",
            "up": "({:.3g}, {:.3g}, {:.3g})".format(*bounds.up),
            "cameras": self._way(),
            "frames": f"{len(self.cameras)}, at most {largest[1]} x {largest[0]} pixels",
            "film": self.film or "none, since frames differ in size or there is only one",
            "eps2d": f"{self.scene.rendering.eps2d:g}",
            "device memory": f"{format_bytes(memory.fixed)} and the tile lists",
            "device": self.device.name,
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report for each frame."""
        folder, total = self.settings.out, len(self.cameras)
        self.folder.make()
        self.folder.begin(*_LEFT)
        make_folder(folder / "frames")
        renderer = Renderer(self.scene.rendering, device=self.device)
        splats = self.scene.splats.upload(self.device)
        behind = self.device.array(self.scene.background)
        window = (0.0, 0.0)
        if self.settings.depth:
            window = depth_window(renderer, splats, self.cameras)
        depth: DepthKind | None = "expected" if self.settings.depth else None
        normals = None
        if self.settings.normals:
            normals = NormalPictures(renderer, self.scene.splats, splats)
        sheet = Sheet(total, self._maps)
        with self._film_file() as add:
            for number, camera in enumerate(self.cameras):
                pictures = self._kept(number)
                if not pictures:
                    image, seen = renderer.picture(splats, camera, background=behind, depth=depth)
                    self._unseen += bool(seen.min() >= 1)
                    pictures = self._save(number, image, seen, window)
                    if normals is not None:
                        pictures.append(self._save_normals(number, *normals.seen(camera)))
                add(shrunk(pictures[0], max(camera.size)))
                sheet.add(number, [shrunk(picture, _MOVING) for picture in pictures])
                yield Report(number + 1, total, "frames")
        self._finish(sheet, [_frame_file(number) for number in range(total)], window)

    def _kept(self, number: int) -> list[NDArray[np.float32]]:
        """A frame that the run left which is gone on with, and its maps; else nothing."""
        names = [_frame_file(number), *(f"{name}/{number:04}.png" for name in self._maps)]
        files = [self.settings.out / name for name in names]
        if not (self.folder.unfinished and all(file.is_file() for file in files)):
            return []
        return [read_image(file) for file in files]

    @property
    def _maps(self) -> tuple[str, ...]:
        """What is written of a frame beside its colours; names of folders."""
        return tuple(name for name in ("depth", "normals") if getattr(self.settings, name))

    def _save(
        self,
        number: int,
        image: NDArray[np.float32],
        seen: NDArray[np.float32],
        window: tuple[float, float],
    ) -> list[NDArray[np.float32]]:
        """Write a frame, and its depth if that is wanted; gives back their pictures."""
        pictures = [in_display_light(image[..., :3], self.scene.light)]
        write_png(self.settings.out / _frame_file(number), pictures[0])
        if self.settings.depth:
            alpha = np.clip(1 - seen, 0, 1)
            pictures.append(self._save_depth(number, image[..., -1], alpha, window))
        return pictures

    def _save_depth(
        self,
        number: int,
        depth: NDArray[np.float32],
        alpha: NDArray[np.float32],
        window: tuple[float, float],
    ) -> NDArray[np.float32]:
        """Depth, 0 where nothing is; gives back its picture."""
        kept = np.where(alpha > LEAST_ALPHA, depth, 0).astype(np.float32)
        return self._save_map("depth", number, kept[..., None], depth_picture(kept, alpha, window))

    def _save_normals(
        self, number: int, normals: NDArray[np.float32], alpha: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Normals, 0 where nothing is; gives back their picture."""
        return self._save_map("normals", number, normals, normal_picture(normals, alpha))

    def _save_map(
        self, name: str, number: int, values: NDArray[np.float32], picture: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Values as an OpenEXR of float32, and a picture of them, which is given back."""
        folder = make_folder(self.settings.out / name)
        with atomic_path(folder / f"{number:04}.exr") as part:
            write_pixels(part, values, format="openexr", attributes={})
        write_png(folder / f"{number:04}.png", picture)
        return picture

    def _finish(self, sheet: Sheet, names: list[str], window: tuple[float, float]) -> None:
        folder, bounds = self.settings.out, self.bounds
        write_json(folder / "transforms.json", transforms_of(self.cameras, names))
        if self.settings.path is None:
            keys = evenly(len(names), _KEYS)
            chosen = [self.cameras[k] for k in keys], [names[k] for k in keys]
            write_json(folder / "key_frames.json", transforms_of(*chosen))
        self.metrics = {
            "frames": len(self.cameras),
            "splats": len(self.scene.splats),
            "center": bounds.center,
            "radius": bounds.radius,
            "up": bounds.up,
            "degrees_to_photographs": farthest_from_cameras(self.cameras, bounds),
            "eps2d": self.scene.rendering.eps2d,
            "background": self.scene.background,
            "film": self.film,
            "depth_window": list(window) if self.settings.depth else None,
        }
        write_bytes(folder / "contact.png", sheet.contact())
        rate = self.settings.rate
        if self._kind == "apng":
            write_bytes(folder / str(self.film), sheet.moving(rate))
        self.moving = None if self._kind is None else sheet.embedded(rate)
        page = render_page(self.scene.name, sheet, self.moving, self.metrics)
        self.folder.finish(self.decided, self.metrics, page, self.device, asked=self.settings)


def _lens_notes(views: Sequence[View]) -> tuple[str, ...]:
    """Whether views have lenses that distort, which frames are drawn without."""
    count = sum(view.lens is not None for view in views)
    if not count:
        return ()
    return (
        f"{count} of {len(views)} views of --path have a lens that distorts: frames are drawn "
        "without distortion",
    )


def _frame_file(number: int) -> str:
    return f"frames/{number:04}.png"
