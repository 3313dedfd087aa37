"""Readers of splat formats written for the tests alone, from the formats' descriptions.

They are as plain as can be, a splat at a time where that is clearer, and share nothing with the
encoders but the descriptions.
"""

from __future__ import annotations

import gzip
import io
import json
import struct
import zipfile
from typing import Any

import numpy as np
from PIL import Image

C0 = 0.28209479177387814


def read_compressed_ply(content: bytes) -> dict[str, np.ndarray]:
    head, body = content.split(b"end_header\n", 1)
    counts, kinds, names = {}, {}, {}
    for line in head.decode().split("\n"):
        words = line.split()
        if words[:1] == ["element"]:
            element, counts[words[1]] = words[1], int(words[2])
            kinds[element], names[element] = [], []
        if words[:1] == ["property"]:
            kinds[element].append({"float": "<f4", "uint": "<u4", "uchar": "u1"}[words[1]])
            names[element].append(words[2])
    tables = {}
    for element, count in counts.items():
        record = np.dtype(list(zip(names[element], kinds[element], strict=True)))
        tables[element] = np.frombuffer(body, record, count)
        body = body[count * record.itemsize :]
    assert not body
    chunk, vertex = tables["chunk"], tables["vertex"]
    box = chunk[np.arange(len(vertex)) // 256]

    def lerp(name: str, share: np.ndarray) -> np.ndarray:
        low, high = (box[f"{end}_{name}"].astype(float) for end in ("min", "max"))
        return low + share * (high - low)

    def bits(word: np.ndarray, widths: tuple[int, ...]) -> list[np.ndarray]:
        found, word = [], word.astype(np.uint64)
        for width in reversed(widths):
            found.append((word & np.uint64(2**width - 1)) / (2**width - 1))
            word = word >> np.uint64(width)
        return found[::-1]

    places = bits(vertex["packed_position"], (11, 10, 11))
    scales = bits(vertex["packed_scale"], (11, 10, 11))
    colors = bits(vertex["packed_color"], (8, 8, 8, 8))
    rotation = bits(vertex["packed_rotation"] & 0x3FFFFFFF, (10, 10, 10))
    others = (np.column_stack(rotation) - 0.5) * np.sqrt(2)
    result = {
        "means": np.column_stack([lerp(n, p) for n, p in zip("xyz", places, strict=True)]),
        "log_scales": np.column_stack(
            [lerp(f"scale_{n}", p) for n, p in zip("xyz", scales, strict=True)]
        ),
        "quats": whole_quats(vertex["packed_rotation"] >> 30, others),
        "opacities": colors[3],
        "colors": np.column_stack([lerp(n, p) for n, p in zip("rgb", colors[:3], strict=True)]),
        "rest": np.zeros((len(vertex), 0, 3)),
    }
    if "sh" in tables:
        rows = np.array(tables["sh"].tolist(), float)
        levels = ((rows + 0.5) / 256 - 0.5) * 8
        result["rest"] = levels.reshape(len(rows), 3, -1).transpose(0, 2, 1)
    return result


def read_spz(content: bytes) -> dict[str, np.ndarray]:
    plain = gzip.decompress(content)
    magic, version, count, degree, digits, _, _ = struct.unpack("<IIIBBBB", plain[:16])
    assert (magic, version) == (0x5053474E, 3)
    rest = (degree + 1) ** 2 - 1
    parts, start = [], 16
    for each in (9, 1, 3, 3, 4, 3 * rest):
        part = np.frombuffer(plain, np.uint8, count * each, start).reshape(count, each)
        parts.append(part.astype(np.int64))
        start += count * each
    assert start == len(plain)
    places, alphas, colors, scales, turns, harmonics = parts
    means = np.zeros((count, 3))
    for axis in range(3):
        low, middle, high = places[:, 3 * axis : 3 * axis + 3].T
        number = low + 256 * middle + 65536 * high
        means[:, axis] = np.where(number >= 2**23, number - 2**24, number) / 2**digits
    quats = np.zeros((count, 4))
    for row, (a, b, c, d) in enumerate(turns):
        word = int(a) | int(b) << 8 | int(c) << 16 | int(d) << 24
        largest = word >> 30
        for axis in (3, 2, 1, 0):
            if axis != largest:
                sign = -1 if word >> 9 & 1 else 1
                quats[row, axis] = sign * (word & 511) / 511 / np.sqrt(2)
                word >>= 10
        quats[row, largest] = np.sqrt(1 - np.square(quats[row]).sum())
    return {
        "means": means,
        "log_scales": scales / 16 - 10,
        "quats": np.roll(quats, 1, axis=1),
        "opacities": alphas[:, 0] / 255,
        "colors": 0.5 + C0 * (colors / 255 - 0.5) / 0.15,
        "rest": (harmonics.reshape(count, rest, 3) - 128) / 128,
    }


def read_sog(content: bytes) -> dict[str, np.ndarray]:
    archive = zipfile.ZipFile(io.BytesIO(content))
    meta = json.loads(archive.read("meta.json"))
    assert meta["version"] == 2
    count = meta["count"]

    def pixels(part: str, number: int = 0, count: int | None = count) -> np.ndarray:
        with Image.open(io.BytesIO(archive.read(meta[part]["files"][number]))) as image:
            return np.asarray(image.convert("RGBA")).reshape(-1, 4)[:count].astype(np.int64)

    words = pixels("means") + 256 * pixels("means", 1)
    low, high = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
    curved = low + words[:, :3] / 65535 * np.where(high > low, high - low, 1)
    turns, colors = pixels("quats"), pixels("sh0")
    result = {
        "means": np.sign(curved) * np.expm1(np.abs(curved)),
        "log_scales": np.array(meta["scales"]["codebook"])[pixels("scales")[:, :3]],
        "quats": whole_quats(turns[:, 3] - 252, (turns[:, :3] / 255 - 0.5) * np.sqrt(2)),
        "opacities": colors[:, 3] / 255,
        "colors": 0.5 + C0 * np.array(meta["sh0"]["codebook"])[colors[:, :3]],
        "rest": np.zeros((count, 0, 3)),
    }
    if "shN" in meta:
        rest = (meta["shN"]["bands"] + 1) ** 2 - 1
        table = np.array(meta["shN"]["codebook"])[pixels("shN", 0, None)[:, :3]]
        labels = pixels("shN", 1)
        number = labels[:, 0] + 256 * labels[:, 1]
        assert number.max() < meta["shN"]["count"]
        # 64 vectors to a row, each of them `rest` pixels, so that rows follow each other.
        result["rest"] = table.reshape(-1, rest, 3)[number]
    return result


def read_glb(content: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The document of a GLB, and its accessors' arrays by the attributes' names."""
    magic, version, size = struct.unpack("<4sII", content[:12])
    assert (magic, version, size) == (b"glTF", 2, len(content))
    length, kind = struct.unpack("<I4s", content[12:20])
    assert kind == b"JSON"
    document = json.loads(content[20 : 20 + length])
    binary = content[20 + length + 8 :]
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        kind = {5126: "<f4", 5121: "u1", 5125: "<u4"}[accessor["componentType"]]
        assert view["byteOffset"] % 4 == 0
        count = accessor["count"] * width
        values = np.frombuffer(binary, kind, count, view["byteOffset"])
        arrays.append(values.reshape(-1, width) if width > 1 else values)
    primitive = document["meshes"][0]["primitives"][0]
    named = {name: arrays[number] for name, number in primitive["attributes"].items()}
    if "indices" in primitive:
        named["indices"] = arrays[primitive["indices"]]
    return document, named


def whole_quats(largest: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Quaternions from three components and the number of the one that is left out."""
    quats = np.zeros((len(others), 4))
    for row, (one, three) in enumerate(zip(largest, others, strict=True)):
        quats[row, [k for k in range(4) if k != one]] = three
        quats[row, one] = np.sqrt(max(0, 1 - np.square(three).sum()))
    return quats
