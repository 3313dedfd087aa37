"""Lenses: against root finding, against COLMAP itself, and where a polynomial turns back."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.lens_distortion import LENS_MODELS, Lens, lens_of

SIZE = (480, 640)
K = np.array([[500.0, 0, 310.0], [0, 510.0, 245.0], [0, 0, 1]])
K_ONE_FOCAL = np.array([[500.0, 0, 310.0], [0, 500.0, 245.0], [0, 0, 1]])
# Strong but plausible: the corner moves by 10 to 100 pixels.
COEFFICIENTS = {
    "SIMPLE_RADIAL": (-0.12,),
    "RADIAL": (-0.15, 0.04),
    "OPENCV": (-0.2, 0.06, 0.002, -0.003),
    "FULL_OPENCV": (0.3, -0.05, 0.001, 0.002, 0.01, 0.5, 0.02, 0.003),
    "FOV": (0.9,),
    "SIMPLE_RADIAL_FISHEYE": (0.05,),
    "RADIAL_FISHEYE": (0.05, -0.02),
    "OPENCV_FISHEYE": (0.04, -0.02, 0.01, -0.002),
    "SIMPLE_FISHEYE": (),
    "FISHEYE": (),
    "THIN_PRISM_FISHEYE": (0.03, -0.02, 0.001, 0.002, 0.01, -0.003, 0.002, -0.001),
}
MODELS = sorted(LENS_MODELS)


def lens(model: str) -> Lens:
    simple = model.removesuffix("_FISHEYE") in ("SIMPLE_RADIAL", "RADIAL", "SIMPLE")
    return Lens(model, COEFFICIENTS[model], K_ONE_FOCAL if simple else K)


def pixels(count: int = 60) -> np.ndarray:
    return np.random.default_rng(1).uniform((0, 0), SIZE[::-1], (count, 2))


@pytest.mark.parametrize("model", MODELS)
def test_the_distortion_can_be_undone_over_the_whole_image(model: str) -> None:
    """A root finder that starts at the distorted point finds the point that it came from."""
    from scipy.optimize import root

    made, points = lens(model), pixels(25)
    moved = made.distort(points)
    assert np.abs(moved - points).max() > 5
    for point, place in zip(points, moved, strict=True):
        found = root(lambda p, place=place: made.distort(p) - place, place, tol=1e-10)
        assert found.success
        np.testing.assert_allclose(found.x, point, atol=1e-6)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_is_that_of_colmap(model: str) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP's Python package is not installed")
    if not hasattr(pycolmap.CameraModelId, model):
        pytest.skip("a COLMAP before it had this model")
    made, points = lens(model), pixels()
    focals = [made.K[0, 0]] if made.K[0, 0] == made.K[1, 1] else [made.K[0, 0], made.K[1, 1]]
    camera = pycolmap.Camera(
        model=model,
        width=SIZE[1],
        height=SIZE[0],
        params=[*focals, made.K[0, 2], made.K[1, 2], *made.coefficients],
    )
    rays = np.c_[(points - made.K[:2, 2]) / made.K[[0, 1], [0, 1]], np.ones(len(points))]
    expected = np.array([camera.img_from_cam(ray) for ray in rays])
    np.testing.assert_allclose(made.distort(points), expected, atol=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_the_principal_point_stays_and_small_angles_keep_their_scale(model: str) -> None:
    made = lens(model)
    center = made.K[:2, 2]
    np.testing.assert_allclose(made.distort(center), center, atol=1e-12)
    step = 1e-5 * np.array([[1, 0], [0, 1]])
    scale = {"FOV": 2 * np.tan(0.45) / 0.9}.get(model, 1)
    np.testing.assert_allclose(made.distort(center + step) - center, scale * step, atol=1e-11)


def test_a_fisheye_without_coefficients_is_equidistant() -> None:
    made = Lens("OPENCV_FISHEYE", (0, 0, 0, 0), K_ONE_FOCAL)
    angles = np.array([0.1, 0.5, 1.0, 1.5])
    points = K[:2, 2] + 500 * np.tan(angles)[:, None] * [0.6, 0.8]
    expected = K[:2, 2] + 500 * angles[:, None] * [0.6, 0.8]
    np.testing.assert_allclose(made.distort(points), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "coefficients", "turn"),
    [
        # r (1 + k r^2) turns where 1 + 3 k r^2 = 0.
        ("SIMPLE_RADIAL", (-0.3,), np.sqrt(1 / 0.9)),
        ("FULL_OPENCV", (0, 0, 0, 0, 0, 1, 0, 0), 1.0),
        ("FULL_OPENCV", (0, 0, 0, 0, 0, -1, 0, 0), 1.0),
        ("SIMPLE_RADIAL_FISHEYE", (-0.3,), np.tan(np.sqrt(1 / 0.9))),
    ],
    ids=["polynomial", "quotient", "pole", "fisheye"],
)
def test_nothing_is_seen_twice(model: str, coefficients: tuple[float, ...], turn: float) -> None:
    made = Lens(model, coefficients, np.diag([1.0, 1, 1]))
    radii = np.array([0.1, 0.5, 0.9, 0.999]) * turn
    seen = made.distort(np.c_[radii, np.zeros(4)])[:, 0]
    assert (np.diff(seen) > 0).all()
    beyond = np.array([1.001, 2, 1e3, 1e200, np.inf]) * turn
    assert np.isnan(made.distort(np.c_[beyond, np.zeros(5)])).all()


@pytest.mark.parametrize("omega", [0.0, 1e-200, 1e-9, -0.9])
def test_a_field_of_view_may_be_small_and_has_no_sign(omega: float) -> None:
    points = pixels()
    moved = Lens("FOV", (omega,), K).distort(points)
    expected = Lens("FOV", (abs(omega),), K).distort(points) if omega < 0 else points
    np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_a_lens_that_only_stretches_reaches_everywhere() -> None:
    made = Lens("RADIAL", (0.1, 0.2), np.eye(3))
    assert np.isfinite(made.distort([[100.0, -100.0]])).all()


def test_points_may_have_any_shape() -> None:
    made, points = lens("OPENCV"), pixels(12)
    grid = made.distort(points.reshape(3, 4, 2))
    np.testing.assert_array_equal(grid.reshape(12, 2), made.distort(points))
    for wrong in ([1.0, 2.0, 3.0], 1.0, "ab", [[1.0]]):
        with pytest.raises(ShapeError, match=r"\(\.\.\., 2\)"):
            made.distort(wrong)


def test_equal_lenses_are_equal_and_survive_pickling() -> None:
    made = lens("OPENCV")
    copy = pickle.loads(pickle.dumps(made))
    assert copy == made and hash(copy) == hash(made)
    assert not copy.K.flags.writeable
    assert made != Lens("OPENCV", (-0.2, 0.06, 0.002, 0.003), K)
    assert made != "OPENCV"


@pytest.mark.parametrize("model", ["PINHOLE", "SIMPLE_PINHOLE", *MODELS])
def test_only_what_distorts_is_a_lens(model: str) -> None:
    nothing = [0.0] * len(LENS_MODELS.get(model, ()))
    assert (lens_of(model, nothing, K) is not None) == model.endswith("FISHEYE")
    if nothing:
        found = lens_of(model, COEFFICIENTS[model], K)
        assert found is not None and found.coefficients == COEFFICIENTS[model]


@pytest.mark.parametrize(
    ("model", "coefficients", "matrix", "kind", "message"),
    [
        ("BROWN", (1,), K, InputError, "'BROWN' is not known.*PINHOLE.*THIN_PRISM_FISHEYE"),
        ("RADIAL", (1,), K, ShapeError, r"takes 2 coefficients \(k1, k2\)"),
        ("PINHOLE", (1,), K, ShapeError, "takes no coefficients"),
        ("RADIAL", (0, np.nan), K, NonFiniteError, "k2 of RADIAL is nan"),
        ("RADIAL", ("a", "b"), K, ShapeError, "takes 2"),
        ("RADIAL", (0, 1e300), K, InputError, "no lens is like that"),
        ("FOV", (3.2,), K, InputError, "omega of FOV is 3.2"),
        ("RADIAL", (0, 1), np.eye(2), ShapeError, r"\(3, 3\)"),
        ("RADIAL", (0, 1), K * [[1], [0], [1]], InputError, "positive focal"),
        ("RADIAL", (0, 1), K + np.eye(3)[[1, 0, 2]], InputError, "no skew"),
        ("RADIAL", (0, 1), K * np.nan, NonFiniteError, "finite"),
    ],
)
def test_what_is_no_lens(
    model: str,
    coefficients: tuple[float, ...],
    matrix: np.ndarray,
    kind: type[Exception],
    message: str,
) -> None:
    with pytest.raises(kind, match=message):
        lens_of(model, coefficients, matrix)
