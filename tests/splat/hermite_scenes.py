"""Random splats with Hermite modes on a screen, drawn by the kernels and by their twin."""

import dataclasses

import numpy as np
from scenes import FARTHEST, lists_of, numbers_of, random_scene

from rift_cl.reference.hermite_moments import hermite_moments
from rift_cl.reference.hermite_raster import (
    HermiteRules,
    HermiteSplats,
    graded_pairs,
    hermite_raster,
)
from rift_cl.reference.splat_raster import Rules
from rift_cl.splat.raster import ScreenModes, raster_grad, rasterize
from rift_cl.splat.tile_lists import Tiles


@dataclasses.dataclass(frozen=True)
class HermiteScene:
    """A scene on the screen with the modes of its splats; host arrays.

    ``table`` is what ScreenModes takes, of ``orders`` (shape, colour) and ``colored`` channels.
    """

    scene: object
    table: np.ndarray
    orders: tuple[int, int]
    colored: int

    def upload(self, device):
        splats, lists = self.scene.upload(device)
        modes = ScreenModes(device.array(self.table), *self.orders, self.colored)
        return dataclasses.replace(splats, modes=modes), lists

    def twin(self):
        """The same in float64, as the twin takes it."""
        table = self.table.astype(float)
        shape, tint = (len(graded_pairs(order)) - 1 for order in self.orders)
        return HermiteSplats(
            self.scene.screen.astype(float),
            table[:, :3],
            table[:, 3 : 3 + shape],
            self.scene.features.astype(float),
            table[:, 3 + shape :].reshape(len(table), tint, self.colored),
        )


def hermite_scene(count, size, orders, *, colored=3, strength=0.3, farthest=6.0, seed=0, **options):
    """Splats of random place, shape, weight, depth, colour and modes."""
    scene = reaching(random_scene(count, size, seed=seed, **options), farthest)
    random = np.random.default_rng(seed + 100)
    shape, tint = (len(graded_pairs(order)) - 1 for order in orders)
    modes = strength * random.normal(size=(count, shape + tint * colored))
    table = np.concatenate([whitening(scene.screen), modes], axis=1)
    return HermiteScene(scene, table.astype(np.float32), orders, colored)


def reaching(scene, farthest):
    """The scene with extents of so many standard deviations, and the lists that go with them."""
    screen = scene.screen.copy()
    screen[:, 6:] *= farthest / FARTHEST
    edge = next(edge for edge in (8, 16, 32) if Tiles.of(scene.size, edge) == scene.tiles)
    slots, entries, starts, _ = lists_of(screen, scene.depths, scene.tiles, edge)
    return dataclasses.replace(scene, screen=screen, slots=slots, entries=entries, starts=starts)


def whitening(screen):
    """i00, i10, i11 with (u1, u2) = (i00 dx, i10 dx + i11 dy) and u.u = d^T conic d."""
    a, b, c = screen[:, 2:5].T.astype(float)
    return np.stack([np.sqrt(a - b * b / c), b / np.sqrt(c), np.sqrt(c)], axis=1)


def rules_of(settings):
    smooth, additive = settings.smooth_cutoff, settings.mode == "xray"
    rules = Rules(settings.tile or 16, settings.alpha_cap, additive, smooth)
    return HermiteRules(rules, settings.activation)


def draw(device, given, settings, background=None):
    """Splats and lists on the device, and what was drawn of them."""
    splats, lists = given.upload(device)
    background = None if background is None else device.array(background)
    size = given.scene.size
    return (
        splats,
        lists,
        rasterize(device, splats, lists, size, settings=settings, background=background),
    )


def draw_twin(given, settings, background=None, splats=None):
    scene = given.scene
    return hermite_raster(
        *(splats or given.twin(), scene.entries, scene.starts, scene.size, rules_of(settings)),
        background,
    )


def moments(device, given, settings, grad_image, grad_left, background=None):
    """The slots, summed for each splat in float64: (N, P)."""
    splats, lists, raster = draw(device, given, settings, background)
    slots = raster_grad(
        device,
        *(splats, lists, raster, device.array(grad_image), device.array(grad_left)),
        settings=settings,
        background=None if background is None else device.array(background),
    )
    owner = np.repeat(np.arange(len(given.table)), np.diff(given.scene.slots))
    sums = np.zeros((len(given.table), slots.numbers.shape[1]))
    np.add.at(sums, owner, numbers_of(device, slots))
    return sums


def moments_twin(given, settings, grad_image, grad_left, background=None):
    scene = given.scene
    return hermite_moments(
        *(given.twin(), scene.entries, scene.starts, rules_of(settings)),
        *(grad_image.astype(float), grad_left.astype(float), background),
    )
