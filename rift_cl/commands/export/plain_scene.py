"""A fitted scene as every viewer renders it: Gaussians, opacities, harmonics, display light.

What cannot be kept is converted by a stated approximation, and said in a sentence with its error.

- *Modes* become the Gaussian of the same mass, mean and covariance, by Gauss-Hermite quadrature of
  the splat's density; its colour is the mean over that density.
- *Activations* exp and square saturate, alpha = 1 - exp(-E g), which is flatter than a Gaussian: it
  becomes one of the same peak and the same integral, whose standard deviations are greater by
  sqrt(Ein(E) / (1 - exp(-E))).
- *Lobes* and what is reflected of a *shared light* become harmonics of degree 3, and *linear light*
  becomes display light, by least squares over the sphere of directions; with a light, mostly over
  the directions of the photographs, where these are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import exp1

from rift_cl.basis.angular import SphericalHarmonics, angular_basis
from rift_cl.basis.angular.environment import reflected_light
from rift_cl.basis.hermite import Hermite
from rift_cl.commands.export.axes import matrices_of, quaternions_of, sphere
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.io.images.display_light import to_display
from rift_cl.io.scenes.formats.plain import rows_of
from rift_cl.io.scenes.splat_activations import drawn_strengths, logits_of
from rift_cl.io.scenes.splat_basis import SceneBasis
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.splat.orders import order_of

Floats = NDArray[np.float64]

# Directions of the least squares, splats at a time, and the degree that lobes become.
_DIRECTIONS, _BLOCK, _DEGREE = 256, 1024, 3
# Most cameras of those for a shared light, what all directions count beside them, and the distance
# below which a camera stands in a splat.
_CAMERAS, _ELSEWHERE, _NEAREST = 64, 0.05, 1e-30
# Nodes of the quadrature along an axis: exact for products of polynomials to degree 13 together.
_NODES = 7
# What the moments of a splat that is hardly one may be: variances in those of its Gaussian.
_THINNEST, _WIDEST = 0.05, 20.0
# No opacity is more: what the renderer draws at most.
_OPAQUE = 0.999


def plain_scene(scene: SplatScene, cameras: Sequence[Camera] = ()) -> tuple[SplatScene, list[str]]:
    """A scene that every viewer can render, and a sentence for each loss.

    Args:
        scene: of photographs; whether it is antialiased, and its eps2d, are kept.
        cameras: of the photographs: what splats reflect of an environment light is right as those
            see it, where they are given.
    """
    basis, notes = SceneBasis.of(scene), list[str]()
    # A splat without a direction is not drawn, and would be with any other quaternion.
    shown = np.flatnonzero((scene.quats != 0).any(axis=1))
    plain = {
        "means": scene.means.astype(np.float64),
        "log_scales": scene.log_scales.astype(np.float64),
        "quats": np.where((scene.quats == 0).all(1, keepdims=True), [1.0, 0, 0, 0], scene.quats),
        "sh": scene.sh.astype(np.float64),
    }
    logits = scene.logit_opacities
    if not basis.plain:
        logits = _one_gaussian_each(scene, plain, notes)
    if scene.lobes is not None or scene.environment is not None or scene.light == "linear":
        centers = None
        if scene.environment is not None and cameras:
            centers = np.array([cameras[k].center for k in evenly(len(cameras), _CAMERAS)])
        plain["sh"] = _harmonics(scene, plain["sh"], centers, notes)
    rows = {name: values.astype(np.float32) for name, values in plain.items()}
    found = SplatScene(
        rows["means"],
        rows["log_scales"],
        rows["quats"],
        logit_opacities=logits,
        sh=rows["sh"],
        antialiased=scene.antialiased,
        eps2d=scene.eps2d,
    )
    return rows_of(found, shown), notes


def _one_gaussian_each(
    scene: SplatScene, plain: dict[str, Floats], notes: list[str]
) -> NDArray[np.float32]:
    """Undo modes and activation in ``plain``; gives back logits of opacities."""
    basis = SceneBasis.of(scene)
    strengths = drawn_strengths(scene.logit_opacities, "light", scene.activation).astype(np.float64)
    if basis.shape_order or basis.color_order:
        strengths = _moments(scene, plain, strengths)
        notes.append(
            "modes become the Gaussian of the same mass, mean and covariance: what they draw "
            "inside a splat is lost"
        )
    if scene.activation != "clamp":
        strengths = _saturated(plain, strengths)
        notes.append(
            f"the activation {scene.activation} becomes opacity times a Gaussian of the same peak "
            "and the same integral"
        )
    return logits_of(np.clip(strengths, 0, _OPAQUE))


def _harmonics(
    scene: SplatScene, given: Floats, centers: Floats | None, notes: list[str]
) -> Floats:
    """Coefficients (N, K, 3) of harmonics in display light, from (N, L, 3) of what there is."""
    degree = scene.degree if scene.lobes is None else _DEGREE
    if scene.environment is not None:
        degree = max(degree, _DEGREE)
    harmonics, directions = SphericalHarmonics(degree), sphere(_DIRECTIONS)
    functions = harmonics.functions(None, directions)
    solve = np.linalg.pinv(functions)
    sh, total, looked = np.empty((len(scene), (degree + 1) ** 2, 3)), 0.0, _DIRECTIONS
    for start in range(0, len(scene), _BLOCK):
        here = slice(start, start + _BLOCK)
        colors = _colors(scene, given, here, directions)
        if centers is None:
            sh[here] = np.einsum("km,nmc->nkc", solve, colors - 0.5)
            again = np.einsum("mk,nkc->nmc", functions, sh[here])
        else:
            ways = scene.means[here, None].astype(np.float64) - centers
            ways /= np.maximum(np.linalg.norm(ways, axis=2, keepdims=True), _NEAREST)
            seen, looked = harmonics.functions(None, ways), len(centers)
            elsewhere = _ELSEWHERE * looked / _DIRECTIONS
            normal = np.einsum("nvk,nvl->nkl", seen, seen) + elsewhere * functions.T @ functions
            wanted = elsewhere * np.einsum("mk,nmc->nkc", functions, colors - 0.5)
            colors = _colors(scene, given, here, ways)
            wanted += np.einsum("nvk,nvc->nkc", seen, colors - 0.5)
            sh[here] = np.linalg.solve(normal, wanted)
            again = np.einsum("nvk,nkc->nvc", seen, sh[here])
        total += float(np.square(np.maximum(again + 0.5, 0) - colors).sum())
    what = [] if scene.lobes is None else [f"lobes ({scene.angular}) become harmonics"]
    what += [] if scene.environment is None else ["the shared light becomes harmonics"]
    what += [] if scene.light == "display" else ["linear light becomes display light"]
    error = np.sqrt(total / (3 * looked * len(scene)))
    where = "all directions" if centers is None else "the directions of the photographs"
    notes.append(
        f"{' and '.join(what)}, by least squares over {where}: colours differ by {error:.3f} of 1 "
        "(root mean square)"
    )
    if scene.light == "linear":
        notes.append(
            "viewers blend in display light: pictures come out darker wherever splats are seen "
            "through (fit in display light what is to be shown elsewhere)"
        )
    return sh


def _colors(scene: SplatScene, given: Floats, here: slice, directions: Floats) -> Floats:
    """Colours (n, D, 3) in display light of some splats along directions (D, 3) or (n, D, 3)."""
    lobes = None if scene.lobes is None else scene.lobes[here, None]
    basis = angular_basis(scene.angular, given.shape[1])
    colors = basis.evaluate(given[here, None], lobes, directions) + 0.5
    if scene.environment is not None:
        normals, reflectance = scene.normals, scene.reflectance
        assert normals is not None and reflectance is not None
        colors += reflected_light(normals[here], reflectance[here], scene.environment, directions)
    colors = np.maximum(np.nan_to_num(colors), 0)
    if scene.light == "linear":
        shown = colors.astype(np.float32)
        to_display(shown)
        colors = shown.astype(np.float64)
    return colors


def _moments(scene: SplatScene, plain: dict[str, Floats], strengths: Floats) -> Floats:
    """Put the Gaussians of the same moments into ``plain``; gives back their strengths."""
    places, weights = _quadrature()
    shape, tint = (
        None if modes is None else _polynomials(places, modes)
        for modes in (scene.shape_modes, scene.color_modes)
    )
    found = np.empty(len(scene))
    for start in range(0, len(scene), _BLOCK):
        here = slice(start, start + _BLOCK)
        count = len(found[here])
        density = np.ones((count, len(places)))
        if shape is not None:
            density = 1 + np.asarray(scene.shape_modes)[here].astype(np.float64) @ shape.T
        density = density**2 if scene.activation == "square" else np.maximum(density, 0)
        # A splat that is nowhere positive has no moments, and no strength.
        mass = density @ weights
        share = density * weights / np.where(mass > 0, mass, 1)[:, None]
        share[mass <= 0] = weights
        mean = share @ places
        spread = np.einsum("nm,mi,mj->nij", share, places, places)
        spread -= mean[:, :, None] * mean[:, None, :]
        if tint is not None:
            modes = np.asarray(scene.color_modes)[here].astype(np.float64)
            over = np.einsum("nm,mk,nkc->nc", share, tint, modes)
            plain["sh"][here, 0] += over * np.sqrt(4 * np.pi)
        volume = _put(plain, here, mean, spread)
        # A projection loses one of three axes: its peak goes with the mass over two of them.
        found[here] = strengths[here] * mass / volume ** (2 / 3)
    return found


def _put(plain: dict[str, Floats], here: slice, mean: Floats, spread: Floats) -> Floats:
    """Means and covariances in a splat's own units become its place, scales and rotation.

    Returns:
        The roots of the determinants of the covariances.
    """
    values, vectors = np.linalg.eigh(spread)
    values = np.clip(values, _THINNEST, _WIDEST)
    rotations, scales = matrices_of(plain["quats"][here]), np.exp(plain["log_scales"][here])
    frames = rotations * scales[:, None, :]
    plain["means"][here] += np.einsum("nij,nj->ni", frames, mean)
    # F V diag(values) V^T F^T, whose axes are the left singular vectors of F V sqrt(values).
    roots = np.einsum("nij,njk->nik", frames, vectors) * np.sqrt(values)[:, None, :]
    axes, sizes, _ = np.linalg.svd(roots)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    plain["quats"][here] = quaternions_of(axes)
    plain["log_scales"][here] = np.log(np.maximum(sizes, np.finfo(np.float32).tiny))
    return np.asarray(np.sqrt(values.prod(axis=1)))


def _saturated(plain: dict[str, Floats], depths: Floats) -> Floats:
    """Widen splats of optical depths to Gaussians of the same integral; gives back opacities."""
    depths = np.maximum(depths, 1e-6)
    # Ein(E), the integral of 1 - exp(-E exp(-t)) over t from 0 on.
    integral = np.log(depths) + np.euler_gamma + exp1(depths)
    opacities = -np.expm1(-depths)
    plain["log_scales"] += (0.5 * np.log(np.maximum(integral / opacities, 1)))[:, None]
    return np.asarray(opacities)


def _quadrature() -> tuple[Floats, Floats]:
    """Places (M, 3) and weights (M,) of means over a Gaussian of variance 1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    weights /= weights.sum()
    places = np.array(list(product(nodes, repeat=3)))
    return places, np.array([np.prod(parts) for parts in product(weights, repeat=3)])


def _polynomials(places: Floats, modes: NDArray[np.float32]) -> Floats:
    """(M, K - 1) the normalised Hermite polynomials that these modes are of."""
    order = order_of(modes.shape[1] + 1)
    table = np.stack([_along(places[:, axis], order) for axis in range(3)])
    index = Hermite(order, 3).indices()[1:]
    return np.asarray(table[0][index[:, 0]] * table[1][index[:, 1]] * table[2][index[:, 2]]).T


def _along(values: Floats, order: int) -> Floats:
    """(order + 1, M) He_n / sqrt(n!), by their recurrence."""
    rows = [np.ones_like(values), values]
    for n in range(1, order):
        rows.append((values * rows[n] - np.sqrt(n) * rows[n - 1]) / np.sqrt(n + 1))
    return np.stack(rows[: order + 1])
