"""A small scan whose answer is known and a small capture, in the files that people have."""

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest
from test_trainer import Ball

import rift_cl as rift
from rift_cl.io.images.image import write_png

BINS, VIEWS, ROWS, CENTER, PITCH = 96, 150, 3, 45.0, 0.2


@dataclass(frozen=True)
class Scan:
    """Paths of the same scan as counts (h5) and as line integrals (npz), and the true slice."""

    counts: Path
    integrals: Path
    truth: np.ndarray


@pytest.fixture(scope="session")
def scan(tmp_path_factory) -> Scan:
    folder = tmp_path_factory.mktemp("scan")
    angles = np.arange(VIEWS) * np.pi / VIEWS
    grid = rift.Grid((70, 70), PITCH)
    geometry = rift.Parallel(angles, BINS, PITCH, CENTER)
    slice_integrals = 0.2 * rift.phantom.shepp_logan_sinogram(grid, geometry)
    integrals = np.repeat(slice_integrals[:, None], ROWS, axis=1)
    counts, npz = folder / "scan.h5", folder / "scan.npz"
    np.savez(npz, projections=integrals, angles=angles, pitch=PITCH)
    random = np.random.default_rng(0)
    dark, gain = random.uniform(90, 110, (ROWS, BINS)), random.uniform(1e4, 3e4, (ROWS, BINS))
    with h5py.File(counts, "w") as file:
        group = file.create_group("exchange")
        group["data"] = (dark + gain * np.exp(-integrals)).astype(np.float32)
        group["data_white"] = np.repeat((dark + gain)[None], 2, 0).astype(np.float32)
        group["data_dark"] = np.repeat(dark[None], 2, 0).astype(np.float32)
        group["theta"] = np.rad2deg(angles)
    truth = np.zeros((BINS, BINS), np.float32)
    inner = (BINS - 70) // 2
    truth[inner:-inner, inner:-inner] = 0.2 * rift.phantom.shepp_logan(grid)
    return Scan(counts, npz, truth)


@pytest.fixture(scope="session")
def capture(tmp_path_factory):
    """A ball of splats seen by eight cameras, as a NeRF capture with a grey background."""
    folder = tmp_path_factory.mktemp("capture")
    ball = Ball(rift.default_device())
    frames = []
    for number, (camera, image) in enumerate(zip(ball.cameras, ball.images, strict=True)):
        write_png(folder / f"{number}.png", np.clip(image, 0, 1))
        pose = np.linalg.inv(camera.view)
        pose[:3, 1:3] *= -1
        frames.append({"file_path": f"{number}.png", "transform_matrix": pose.tolist()})
    fx, fy, cx, cy = ball.cameras[0].intrinsics
    lens = {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": 80, "h": 60}
    (folder / "transforms.json").write_text(json.dumps({**lens, "frames": frames}))
    return folder
