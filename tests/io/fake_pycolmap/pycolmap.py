"""Stands for pycolmap where only the way round it is tested: places photographs in a row.

FAKE_PYCOLMAP says what goes wrong: "none" (no model), "hang", "exit", "raise", or "but NAME"
(all are placed but that one). What it was asked is written to the file FAKE_PYCOLMAP_SEEN. The
photographs have the width and height in FAKE_PYCOLMAP_SIZE, or 12 and 8.
"""

import json
import os
import struct
import time
from pathlib import Path

__version__ = "9.9"

FAULT = os.environ.get("FAKE_PYCOLMAP", "")
SEEN: dict = {"groups": []}


class Device:
    cpu = 0


class CameraMode:
    SINGLE = 1


class Seeded:
    random_seed = -1


class TwoViewGeometryOptions:
    def __init__(self) -> None:
        self.ransac = Seeded()


class ExhaustivePairingOptions:
    block_size = 50


class IncrementalMapperOptions(Seeded):
    num_threads = -1


class IncrementalPipelineOptions(Seeded):
    min_model_size = 10
    num_threads = -1

    def __init__(self) -> None:
        self.mapper = IncrementalMapperOptions()


class Image:
    def __init__(self, name: str) -> None:
        self.name = name


class Reconstruction:
    def __init__(self, names: list) -> None:
        self.images = {number: Image(name) for number, name in enumerate(names, 1)}

    def num_reg_images(self) -> int:
        return len(self.images)

    def num_points3D(self) -> int:
        return 1

    def reg_image_ids(self) -> list:
        return list(self.images)

    def write_binary(self, folder: str) -> None:
        width, height = map(int, os.environ.get("FAKE_PYCOLMAP_SIZE", "12 8").split())
        camera = struct.pack("<QIiQQ3d", 1, 7, 0, width, height, 20, width / 2, height / 2)
        Path(folder, "cameras.bin").write_bytes(camera)
        content = struct.pack("<Q", len(self.images))
        for number, image in self.images.items():
            content += struct.pack("<I7dI", number, 1, 0, 0, 0, number, 0, 0, 7)
            content += image.name.encode() + b"\0" + bytes(8)
        Path(folder, "images.bin").write_bytes(content)
        point = struct.pack("<QQ3d3BdQ", 1, 1, 0, 0, 5, 255, 128, 0, 0.5, 0)
        Path(folder, "points3D.bin").write_bytes(point)


def set_random_seed(seed: int) -> None:
    SEEN["seed"] = seed


def import_images(database: str, images: str, mode: int, names: list) -> None:
    assert Path(database).read_bytes() == b"" and mode == CameraMode.SINGLE
    assert all(Path(images, name).is_file() for name in names)
    SEEN["groups"].append(names)
    SEEN["images"] = images


def extract_features(database: str, images: str, names: list, *, device: int) -> None:
    for number in range(len(names)):
        print(f"I0 feature_extraction.cc:1] Processed file [{number + 1}/{len(names)}]")
    SEEN["names"] = names


def match_exhaustive(
    database: str,
    *,
    device: int,
    pairing_options: ExhaustivePairingOptions,
    verification_options: TwoViewGeometryOptions,
) -> None:
    print("I0 pairing.cc:1] Processing block [2/2, 1/2]\n\xff no text", flush=True)
    SEEN["matched"] = ["all", verification_options.ransac.random_seed]


def match_sequential(
    database: str, *, device: int, verification_options: TwoViewGeometryOptions
) -> None:
    print("I0 pairing.cc:1] Processing image [3/4]")
    SEEN["matched"] = ["near", verification_options.ransac.random_seed]


def incremental_mapping(
    database: str, images: str, output: str, *, options: IncrementalPipelineOptions
) -> dict:
    print("I0 incremental_pipeline.cc:1] Registering image #7 (num_reg_frames=2)", flush=True)
    Path(os.environ["FAKE_PYCOLMAP_SEEN"]).write_text(json.dumps(SEEN))
    assert Path(output).is_dir()
    for part in (options, options.mapper):
        assert part.num_threads == 1 and part.random_seed == SEEN["seed"]
    names = [name for group in SEEN["groups"] for name in group]
    if FAULT == "hang":
        time.sleep(60)
    if FAULT == "exit":
        os._exit(3)
    if FAULT == "raise":
        raise ValueError("[scene.cc:12] Check failed: a > b")
    if FAULT == "none":
        return {}
    whole = Reconstruction([name for name in names if f"but {name}" != FAULT])
    return {0: Reconstruction(names[:2]), 1: whole}
