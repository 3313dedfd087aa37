"""How true filtered backprojection of cones is: levels of a uniform ball, and what a roll costs.

    python tools/check_fdk.py
    python tools/check_fdk.py --size 128 --views 240

Data are exact line integrals, averaged over the bins as a detector does. Means are taken within 0.8
of the ball's radius, over its density, which is 1 at best: in the plane of the source's orbit, for
magnifications and for bins of so many voxels; and over the whole ball, for half-angles of the cone
that the ball fills, beside the iterative result. A ball of few bins is off by the ripple that its
edge leaves, whatever the rays: textbook parallel beams of the same bins stand beside. Helices are
those of Katsevich's method. The head shows what a detector's roll costs.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

import rift_cl as rift
from bench.ball_psnr import ball_psnr

MAGNIFICATIONS = (1.2, 1.5, 3.0, 6.0, 15.0)
PITCHES = (0.5, 0.75, 1.0, 1.3, 2.0)
HALF_ANGLES = (2.0, 5.0, 10.0, 15.0)
ROLLS = (0.5, 2.0)
# Rises of a helix in a turn, in edges of the volume, and the cone's half-angle.
RISES, HELIX_ANGLE = (0.25, 0.5, 1.0), 10.0
# Radius of the ball, as a share of the volume's edge, and what of it is looked at.
BALL, INNER = 0.35, 0.8


def main() -> None:
    """Print a line for each figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=64, help="edge of the volume in samples")
    parser.add_argument("--views", type=int, default=120, help="number of views")
    parser.add_argument("--steps", type=int, default=30, help="steps of CGLS")
    given = parser.parse_args()
    for curved in (False, True):
        name = "curved" if curved else "flat"
        for magnification in MAGNIFICATIONS:
            mean = middle_plane(given, magnification=magnification, curved=curved)
            print(f"middle plane, {name}, magnification {magnification:g}: {mean:.4f}", flush=True)
        for pitch in PITCHES:
            mean = middle_plane(given, pitch=pitch, curved=curved)
            across = 2 * BALL * given.size / pitch
            line = f"middle plane, {name}, bins of {pitch:g} voxels, {across:.0f} across the ball"
            beams = textbook(given, pitch)
            print(f"{line}: {mean:.4f}, parallel beams {beams:.4f}", flush=True)
    for degrees in HALF_ANGLES:
        fdk, cgls = whole_ball(given, degrees)
        print(f"whole ball, half-angle {degrees:g} degrees: {fdk:.4f}, CGLS {cgls:.4f}", flush=True)
    for rise in RISES:
        for curved in (False, True):
            name, mean = "curved" if curved else "flat", helical(given, rise, curved=curved)
            line = f"whole ball, half-angle {HELIX_ANGLE:g} degrees, helix, {name}"
            print(f"{line}, rise of {rise:g} edges in a turn: {mean:.4f}", flush=True)
    for degrees in ROLLS:
        upright, known, ignored = rolled(given, degrees)
        line = f"head, roll of {degrees:g} degrees: {known:.2f} dB, {ignored:.2f} dB if ignored"
        print(f"{line}, {upright:.2f} dB without", flush=True)


def middle_plane(given: argparse.Namespace, **changes: Any) -> float:
    """The mean in the two slices next to the orbit, of ``circle`` with these changes."""
    scan = circle(given, **changes)
    # Those that the two slices are seen in, and those next to them.
    rows = 2 * int(np.ceil(scan.magnification / scan.pitch[0])) + 4
    scan = replace(scan, rows=rows, center=((rows - 1) / 2, scan.center[1]))
    grid = rift.Grid((2, given.size, given.size))
    data = averaged(ball(given), grid, scan, 12)
    return level(rift.fbp(rift.Projector(grid, scan), data))


def textbook(given: argparse.Namespace, pitch: float) -> float:
    """The mean that parallel beams have of the same ball and bins: nothing here is ours.

    Rows of exact integrals averaged over the bins, Ramachandran and Lakshminarayanan's filter,
    linear interpolation, and as many directions as make no difference.
    """
    radius, fine = BALL * given.size, 200
    bins = circle(given, pitch=pitch).bins
    s = pitch * ((np.arange(bins * fine) + 0.5) / fine - bins / 2)
    z = pitch * ((np.arange(50) + 0.5) / 50)[:, None]
    chords = 2 * np.sqrt(np.maximum(radius**2 - s**2 - z**2, 0)).mean(axis=0)
    away = np.arange(1 - bins, bins)
    ramp = np.where(away % 2 == 1, -1 / (np.pi * pitch * np.where(away == 0, 1, away)) ** 2, 0.0)
    ramp[away == 0] = 1 / (2 * pitch) ** 2
    row = pitch * np.convolve(chords.reshape(bins, fine).mean(axis=1), ramp, "valid")
    places = np.arange(given.size) - (given.size - 1) / 2
    y, x = np.meshgrid(places, places, indexing="ij")
    inside = x**2 + y**2 + 0.25 < (INNER * radius) ** 2
    centers = pitch * (np.arange(bins) - (bins - 1) / 2)
    angles = np.arange(720) * np.pi / 720
    seen = [np.interp(np.cos(a) * x[inside] + np.sin(a) * y[inside], centers, row) for a in angles]
    return float(np.pi * np.mean(seen))


def whole_ball(given: argparse.Namespace, degrees: float) -> tuple[float, float]:
    """The mean in the ball by filtered backprojection and by CGLS, for a cone's half-angle."""
    grid, scan = volume(given), circle(given, distance=BALL / np.sin(np.deg2rad(degrees)))
    A, data = rift.Projector(grid, scan), averaged(ball(given), grid, scan, 4)
    return level(rift.fbp(A, data)), level(rift.cgls(A, data, given.steps))


def helical(given: argparse.Namespace, rise: float, *, curved: bool) -> float:
    """The mean in the ball from a helix, for a rise in a turn in edges of the volume."""
    distance = BALL / np.sin(np.deg2rad(HELIX_ANGLE))
    grid, scan = volume(given), circle(given, distance=distance, curved=curved)
    views = round(given.views * (1 + 1.7 * rise) / rise)
    angles = 2 * np.pi * (np.arange(views) - (views - 1) / 2) / given.views
    scan = replace(scan, angles=angles, heights=rise * given.size * angles / (2 * np.pi))
    return level(rift.fbp(rift.Projector(grid, scan), averaged(ball(given), grid, scan, 3)))


def volume(given: argparse.Namespace) -> rift.Grid:
    """The volume, of voxels of length 1."""
    return rift.Grid((given.size,) * 3)


def circle(
    given: argparse.Namespace,
    *,
    pitch: float = 1.0,
    magnification: float = 1.5,
    distance: float = 3.0,
    curved: bool = False,
) -> rift.Cone:
    """A full turn whose detector just sees the ball in the volume.

    Args:
        given: size and views.
        pitch: of the bins at the axis, in voxels.
        magnification: of the detector.
        distance: of the source from the axis, in edges of the volume.
        curved: whether rows are arcs about the source.
    """
    angles = 2 * np.pi * np.arange(given.views) / given.views
    to_axis = distance * given.size
    bins = 2 * int(np.ceil(to_axis * np.tan(np.arcsin(0.51 / distance)) / pitch))
    on_detector, to_detector = pitch * magnification, to_axis * magnification
    return rift.Cone(angles, bins, bins, on_detector, to_axis, to_detector, curved=curved)


def ball(given: argparse.Namespace) -> list[rift.phantom.Ellipsoid]:
    """The uniform ball."""
    return [rift.phantom.Ellipsoid.ball(BALL * given.size)]


def averaged(
    parts: list[rift.phantom.Ellipsoid], grid: rift.Grid, scan: rift.Cone, fine: int
) -> np.ndarray:
    """Line integrals averaged over the bins, each read at so many places along its edges."""
    pitch = tuple(length / fine for length in scan.pitch)
    center = tuple((place + 0.5) * fine - 0.5 for place in scan.center)
    rows, bins = scan.rows * fine, scan.bins * fine
    rays = rift.phantom.project(
        parts, grid, replace(scan, pitch=pitch, center=center, rows=rows, bins=bins)
    )
    return rays.reshape(scan.views, scan.rows, fine, scan.bins, fine).mean((2, 4))


def level(volume: np.ndarray) -> float:
    """The mean within the ball."""
    places = [np.arange(n) - (n - 1) / 2 for n in volume.shape]
    z, y, x = np.meshgrid(*places, indexing="ij")
    inside = x**2 + y**2 + z**2 < (INNER * BALL * volume.shape[-1]) ** 2
    return float(volume[inside].mean(dtype=float))


def rolled(given: argparse.Namespace, degrees: float) -> tuple[float, float, float]:
    """PSNR of the head without a roll, with one that is known, and with one that is ignored."""
    grid, scan = volume(given), circle(given)
    head = rift.phantom.head(grid)
    truth, upright = rift.phantom.render(head, grid), scan.vectors()
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    across = cosine * upright.across + sine * upright.down
    down = cosine * upright.down - sine * upright.across
    turned = replace(upright, across=across, down=down)
    straight, data = (rift.phantom.project(head, grid, each) for each in (scan, turned))

    def quality(scan: rift.Cone | rift.Vectors, data: np.ndarray) -> float:
        return ball_psnr(rift.fbp(rift.Projector(grid, scan), data), truth)

    return quality(scan, straight), quality(turned, data), quality(scan, data)


if __name__ == "__main__":
    main()
