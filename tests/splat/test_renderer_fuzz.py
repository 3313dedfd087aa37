"""The whole renderer against hostile numbers: what is culled leaves no trace, the rest stays sane.

Scenes are ordinary splats in many places, some of whose numbers are replaced by NaN, infinities,
denormals, zeros and numbers at the edges of float32. Kernels are compiled for a few ways to draw,
which together have every option; what is no macro is drawn by hypothesis.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from projection_scenes import LENS, Kind, arrays_of, random_splats, sent, shaped, turned

import rift_cl as rift
from rift_cl.errors import DeviceError, DTypeError, InputError, ShapeError
from rift_cl.splat import Renderer, Splats, SplatSettings

pytestmark = pytest.mark.dealt


@dataclass(frozen=True)
class Way(Kind):
    """One way to draw, as kernels are compiled for it."""

    sh: int = 0
    colors: int = 0
    depth: str | None = None

    @property
    def background(self):
        return np.linspace(0.1, 0.9, self.colors + 3 * bool(self.sh)).astype(np.float32)


WAYS = {  # model, covariances, settings, coefficients of harmonics, colours, depth
    "sh": Way("pinhole", False, SplatSettings(tile=8), 4, 0),
    "all channels": Way("pinhole", True, SplatSettings(absgrad=True), 4, 2, "expected"),
    "antialiased": Way("pinhole", False, SplatSettings(antialiased=True), 0, 5, "accumulated"),
    "lens": Way("pinhole", False, SplatSettings(), 1, 2, "expected", aperture=LENS),
    "ortho": Way("ortho", True, SplatSettings(absgrad=True, tile=8), 0, 3, "accumulated"),
    "fisheye": Way("fisheye", False, SplatSettings(tile=32), 1, 1, "expected"),
    "fisheye antialiased": Way("fisheye", True, SplatSettings(antialiased=True, absgrad=True), 9),
    "xray": Way("pinhole", False, SplatSettings(mode="xray", absgrad=True, tile=32), 0, 1),
    "ortho xray": Way("ortho", True, SplatSettings(mode="xray"), 4, 2),
}
HOSTILE = [
    *(np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-45, -1e-40, 1.2e-38, 1e-30, 1e-19, -1e-12, 1e-6),
    *(-1.0, 0.5 / 255, 7.0, 1e4, -1e9, 1e12, 1e19, -1e19, 1e30, 3e38, -3e38),
]
# Middle and spread of where splats stand, in the camera's frame.
PLACES = {
    "ahead": (0, 0, 4, 1),
    "at one depth": (0.3, 0.2, 4, 0),
    "at the camera": (0, 0, 0, 0),
    "on the near plane": (0, 0, 0.0101, 0.001),
    "behind": (0, 0, -3, 1),
    "beside": (9, -2, 0.05, 0.02),
}
SHAPES = ("means", "quats", "scales", "covars", "opacities")
BLIND = [("size", (0, 5)), ("K", np.diag([0, 1, 1])), ("view", np.full((4, 4), np.nan))]


@dataclass(frozen=True)
class Scene:
    """What hypothesis draws; ``odd`` are (splat, parameter, column, value)."""

    seed: int = 0
    places: tuple[str, ...] = ("ahead",) * 7
    size: tuple[int, int] = (20, 31)
    odd: tuple[tuple[int, str, int, float], ...] = ()
    changes: dict[str, float] = field(default_factory=dict)

    def camera(self, model, aperture=None):
        focal = {"pinhole": 45.0, "ortho": 9.0, "fisheye": 30.0}[model]
        view = np.eye(4)
        view[:3, :3], view[:3, 3] = turned(self.seed), [0.1, -0.2, 0.3]
        K = [[focal, 0, self.size[1] / 2], [0, 1.1 * focal, self.size[0] / 2 - 0.2], [0, 0, 1]]
        return rift.Camera(self.size, K, view, model, aperture)

    def values(self, chosen):
        """Host arrays, hostile numbers included."""
        count, random = len(self.places), np.random.default_rng(self.seed)
        values = random_splats(count, self.seed, coefficients=chosen.sh or 1)
        values["colors"] = random.normal(size=(count, chosen.colors)).astype(np.float32)
        values = {name: some for name, some in values.items() if getattr(chosen, name, True)}
        places = np.array([PLACES[place] for place in self.places]).reshape(count, 4)
        points = places[:, :3] + places[:, 3:] * random.uniform(-1, 1, (count, 3))
        view = self.camera("pinhole").view
        values["means"] = ((points - view[:3, 3]) @ view[:3, :3]).astype(np.float32)
        values = shaped(values, chosen)
        for splat, name, column, value in self.odd:
            if name in values and splat < count:
                row = values[name].reshape(count, -1)
                row[splat, column % row.shape[1]] = value
        return values

    def odd_in(self, *names):
        """Which splats may have a hostile number in one of these parameters."""
        touched = {splat for splat, name, _, _ in self.odd if name in names}
        return np.array([i in touched for i in range(len(self.places))], bool)


def scenes(*names):
    odd = (st.integers(0, 39), st.sampled_from(names), st.integers(0, 26), st.sampled_from(HOSTILE))
    places = st.lists(st.sampled_from([*PLACES]), max_size=8)
    changes = {"eps2d": [0.3, 0.05, 0.0], "radius_clip": [0.0, 3.0], "alpha_cap": [0.99, 0.999]}
    return st.builds(
        Scene,
        seed=st.integers(0, 1000),
        places=places.map(lambda some: tuple(5 * some)),
        size=st.tuples(st.integers(1, 50), st.integers(1, 70)),
        odd=st.lists(st.tuples(*odd), max_size=30).map(tuple),
        changes=st.fixed_dictionaries({n: st.sampled_from(v) for n, v in changes.items()}),
    )


def run(device, chosen, scene, values):
    """A frame and its gradient: host arrays of both, and how many were culled."""
    renderer = Renderer(replace(chosen.settings, **scene.changes), device=device)
    splats, background = sent(device, values), device.array(chosen.background)
    camera = scene.camera(chosen.model, chosen.aperture)
    frame = renderer.forward(splats, camera, background=background, depth=chosen.depth)
    random = np.random.default_rng(scene.seed)
    coming = [device.array(random.normal(size=a.shape)) for a in (frame.image, frame.transmittance)]
    found = renderer.backward(frame, *coming, with_camera=True)
    raster = {name: vars(frame.raster)[name] for name in ("image", "transmittance", "last")}
    arrays = arrays_of(frame.projection) | raster
    arrays |= {"features": frame.raster_pass.screen.features}
    arrays |= {"coming": coming[0], "by camera": found.camera, "by background": found.background}
    gradients = vars(found.splats) | {"colors": found.colors, "sh": found.sh}
    # These have a row for a run of splats.
    del gradients["camera"], gradients["aperture"]
    hosts = [
        {name: device.get(array) for name, array in some.items() if array is not None}
        for some in (arrays, gradients)
    ]
    return *hosts, renderer.culled(frame)


def checked(device, chosen, scene):
    """Check the laws that hold whatever the numbers are; gives the frame and its gradients."""
    values = scene.values(chosen)
    frame, gradients, culled = run(device, chosen, scene, values)
    drawn, thin = frame["culled"] == 0, frame["transmittance"]
    assert sum(culled.values()) == len(drawn) and culled.get("visible", 0) == drawn.sum()
    assert ((thin > np.float32(1e-4)) & (thin <= 1)).all()
    alone, by_alone, _ = run(device, chosen, scene, {n: v[drawn] for n, v in values.items()})
    assert np.array_equal(alone["image"], frame["image"], equal_nan=True)
    assert np.array_equal(alone["transmittance"], thin)
    for name, by in gradients.items():
        assert not by[~drawn].any(), name
        assert np.array_equal(by[drawn], by_alone[name], equal_nan=True), name
    return frame, gradients, drawn


def check_mixture(frame, by_features, drawn, changes):
    """A pixel mixes features and background, no splat takes more than its weight, all is shared."""
    most = np.max(np.abs(frame["features"][drawn]), axis=0, initial=1)
    assert (np.abs(frame["image"]) <= most * (1 + 1e-3)).all()
    weights = np.minimum(frame["screen"][drawn, 5].astype(float), changes["alpha_cap"])
    assert frame["transmittance"].min() >= np.prod(1 - weights) * (1 - 1e-3)
    behind, sent = frame["by background"], frame["coming"].astype(float)
    shares = by_features.astype(float).sum(axis=0)[: len(behind)] + behind
    np.testing.assert_allclose(shares, sent.sum((0, 1))[: len(behind)], atol=1e-4 * sent.size)


@pytest.mark.parametrize("name", WAYS)
@settings(deadline=None, max_examples=10)
@given(scene=scenes(*SHAPES))
def test_hostile_splats_spoil_nothing_but_their_own_gradient(device, name, scene):
    frame, gradients, drawn = checked(device, WAYS[name], scene)
    if WAYS[name].settings.mode == "light":
        check_mixture(frame, gradients["features"], drawn, scene.changes)
    elif frame["screen"][:, 5].astype(float).sum() < 1e30:
        assert np.isfinite(frame["image"]).all() and (frame["transmittance"] == 1).all()
    odd = scene.odd_in(*SHAPES)
    assert all(np.isfinite(by[~odd]).all() for by in gradients.values())
    assert odd[drawn].any() or np.isfinite(frame["by camera"]).all()


@pytest.mark.parametrize("name", WAYS)
@settings(deadline=None, max_examples=6)
@given(scene=scenes("sh", "colors", "means"))
def test_hostile_colours_stay_in_the_tiles_of_their_splats(device, name, scene):
    frame, _, drawn = checked(device, WAYS[name], scene)
    clean = np.ones(scene.size, bool)
    boxes = (WAYS[name].settings.tile or 16) * frame["boxes"][drawn & scene.odd_in("sh", "colors")]
    for x0, y0, x1, y1 in boxes:
        clean[y0:y1, x0:x1] = False
    assert np.isfinite(frame["image"][clean]).all()


def test_needle_of_no_width_hides_no_more_than_its_weight(device):
    scene, chosen = Scene(places=("ahead",), changes={"eps2d": 0.0}), WAYS["sh"]
    needle = {"scales": np.float32([[9, 7e-21, 7e-21]]), "opacities": np.float32([0.5])}
    frame, _, _ = run(device, chosen, scene, scene.values(chosen) | needle)
    assert frame["transmittance"].min() >= 0.499


@pytest.mark.parametrize("places", [(), ("behind",) * 5], ids=["no splats", "only culled ones"])
@pytest.mark.parametrize("name", WAYS)
def test_where_nothing_is_drawn_there_is_the_background(device, name, places):
    chosen, scene = WAYS[name], Scene(places=places)
    frame, gradients, culled = run(device, chosen, scene, scene.values(chosen))
    # A fisheye might see them if its picture were wide enough.
    reason = "off screen" if chosen.model == "fisheye" else "out of depth"
    assert culled == ({reason: 5} if places else {})
    behind = chosen.background * (chosen.settings.mode == "light")
    assert (frame["image"] == [*behind, *[0] * (chosen.depth is not None)]).all()
    assert (frame["transmittance"] == 1).all() and not frame["by camera"].any()
    assert all(len(by) == len(places) and not by.any() for by in gradients.values())


@pytest.mark.full
@pytest.mark.parametrize("size, at", [((1, 1), (0, 0)), ((1, 20011), (0, 20003))])
def test_images_of_one_pixel_or_one_row(device, size, at):
    camera = rift.Camera(size, [[30, 0, at[1] + 0.5], [0, 30, 0.5], [0, 0, 1]], np.eye(4))
    values = {"means": [[0, 0, 4]], "covars": [0.01 * np.eye(3)], "opacities": [0.5]}
    splats = Splats.upload(device, **values, colors=[[1.0, 3.0]])
    renderer, background = Renderer(device=device), device.array([5.0, 5.0])
    frame = renderer.forward(splats, camera, background=background, depth="expected")
    image, thin = device.get(frame.image), device.get(frame.transmittance)
    np.testing.assert_allclose(image[at], [3, 4, 4], rtol=1e-5)
    assert (image[thin == 1] == [5, 5, 0]).all() and (thin < 1).sum() in (1, 5)
    by = renderer.backward(frame, device.array(np.ones(image.shape))).colors
    np.testing.assert_allclose(device.get(by), [[(1 - thin).sum()] * 2], rtol=1e-4)


@pytest.mark.parametrize("argument, value", BLIND)
def test_camera_that_shows_nothing_is_refused_in_one_sentence(argument, value):
    with pytest.raises(InputError, match=rf"^Camera: {argument}\S* .*(wanted|must).*$"):
        rift.Camera(**{"size": (4, 5), "K": np.eye(3), "view": np.eye(4), argument: value})


@pytest.mark.parametrize("depth, channels", [(None, 3), ("expected", 4)])
@pytest.mark.parametrize("name", ["background", "grad_image", "grad_transmittance"])
def test_unusable_arrays_are_named(device, name, depth, channels):
    renderer, camera = Renderer(WAYS["sh"].settings, device=device), Scene().camera("pinhole")
    splats = Splats.upload(device, **Scene().values(WAYS["sh"]))
    elsewhere = rift.Device(device._handle, device.selector, traits=device.traits)
    shapes = {"background": (3,), "grad_image": (20, 31, channels), "grad_transmittance": (20, 31)}
    rows, *others = shape = shapes[name]
    for array, error, words in [
        (device.zeros((rows, 2)), ShapeError, r"has shape \(\d+, 2\), wanted"),
        (device.zeros((rows + 1, *others))[1:], ShapeError, "is a view that begins inside"),
        (device.zeros(shape, np.float64), DTypeError, "has type float64"),
        (np.zeros(shape, np.float32), DTypeError, "is a ndarray on the host"),
        (elsewhere.zeros(shape), DeviceError, "lives on another device"),
    ]:
        arrays = {name: device.zeros(shape) for name, shape in shapes.items()} | {name: array}
        background, *coming = arrays.values()
        with pytest.raises(error, match=f"^{name} {words}"):
            frame = renderer.forward(splats, camera, background=background, depth=depth)
            renderer.backward(frame, *coming)
