"""A scene turned and scaled: positions, rotations and the directions of colours, together.

Harmonics of one degree turn into harmonics of the same degree: the matrix between their
coefficients is found by sampling, exactly to rounding, since no degree has more functions than
there are directions.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular import SphericalHarmonics
from rift_cl.errors import InputError
from rift_cl.io.scenes.splat_scene import SplatScene

Floats = NDArray[np.float64]

_DIRECTIONS = 64
# Cosine from which on two directions are opposite.
_OPPOSITE = -1 + 1e-9


def turn_between(start: Floats, end: Floats) -> Floats:
    """(3, 3) the least turn that takes one unit vector to another.

    Of opposite vectors it is half a turn about the axis across them that is nearest to x, so that
    what is right stays right.
    """
    cosine = float(start @ end)
    if cosine <= _OPPOSITE:
        x = np.array([1.0, 0, 0]) if abs(start[0]) < 0.9 else np.array([0.0, 1, 0])
        axis = x - (x @ start) * start
        axis /= np.linalg.norm(axis)
        return np.asarray(2 * np.outer(axis, axis) - np.eye(3))
    x, y, z = np.cross(start, end)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + cosine))


def turned(scene: SplatScene, turn: Floats) -> SplatScene:
    """A scene of plain splats, turned about the origin; itself where there is nothing to turn."""
    if np.array_equal(turn, np.eye(3)):
        return scene
    means = scene.means.astype(np.float64) @ turn.T
    quats = _product(_quaternion(turn), scene.quats.astype(np.float64))
    matrix = harmonics_turn(turn, scene.degree)
    sh = np.einsum("kj,njc->nkc", matrix, scene.sh.astype(np.float64))
    return dataclasses.replace(
        scene,
        means=means.astype(np.float32),
        quats=quats.astype(np.float32),
        sh=sh.astype(np.float32),
    )


def scaled(scene: SplatScene, factor: float) -> SplatScene:
    """A scene of plain splats with every length multiplied by a factor, about the origin."""
    if factor == 1:
        return scene
    means = (scene.means.astype(np.float64) * factor).astype(np.float32)
    log_scales = (scene.log_scales.astype(np.float64) + np.log(factor)).astype(np.float32)
    return dataclasses.replace(scene, means=means, log_scales=log_scales)


def check_scale(factor: float) -> None:
    """Make sure that lengths can be multiplied by a factor.

    Raises:
        InputError: it is not positive and finite.
    """
    if not 0 < factor < np.inf:
        raise InputError(f"--scale is {factor:g}, wanted a factor greater than 0")


def harmonics_turn(turn: Floats, degree: int) -> Floats:
    """(K, K) from coefficients of harmonics to those of the turned function."""
    basis = SphericalHarmonics(degree)
    directions = sphere(_DIRECTIONS)
    here, there = (basis.functions(None, way) for way in (directions, directions @ turn))
    whole = np.zeros((basis.n_linear, basis.n_linear))
    for order in range(degree + 1):
        band = slice(order**2, (order + 1) ** 2)
        whole[band, band] = np.linalg.lstsq(here[:, band], there[:, band], rcond=None)[0]
    return whole


def sphere(count: int) -> Floats:
    """(count, 3) unit vectors spread evenly: Fibonacci's spiral."""
    steps = np.arange(count) + 0.5
    z, angles = 1 - 2 * steps / count, np.pi * (1 + np.sqrt(5)) * steps
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(angles), flat * np.sin(angles), z])


def matrices_of(quats: Floats) -> Floats:
    """(N, 3, 3) rotations by quaternions (w, x, y, z) of any length but zero."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def quaternions_of(matrices: Floats) -> Floats:
    """(N, 4) quaternions (w, x, y, z) of rotations (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.roll(np.asarray(Rotation.from_matrix(matrices).as_quat()), 1, axis=1)


def _quaternion(turn: Floats) -> Floats:
    return np.asarray(quaternions_of(turn[None])[0])


def _product(left: Floats, right: Floats) -> Floats:
    """Quaternions (N, 4) of the turns ``right`` followed by the turn ``left``."""
    w, v = left[0], left[1:]
    scalars = w * right[:, 0] - right[:, 1:] @ v
    vectors = w * right[:, 1:] + right[:, :1] * v + np.cross(v, right[:, 1:])
    return np.column_stack([scalars, vectors])
