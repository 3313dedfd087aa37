"""Kept slabs are checked by their headers before anything is allocated for them."""

import io
import os

import numpy as np
import pytest

from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.errors import CheckpointError


def header(shape, dtype="<f4"):
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": dtype, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


def archive():
    file = io.BytesIO()
    np.savez(file, a=np.zeros(3))
    return file.getvalue()


FORGED = {
    "larger than any memory": header((1 << 20, 1 << 20, 1 << 20)),
    "another shape": header((2, 4, 3)) + bytes(96),
    "another type": header((2, 3, 4), "<f8") + bytes(192),
    "objects": header((2, 3, 4), "|O") + bytes(192),
    "an archive": archive(),
    "nothing": b"",
    "a header of brackets": b"\x93NUMPY\x01\x00\x06\x00(((((\n",
    "a header without an end": b"\x93NUMPY\x01\x00\x06\x00''''''",
    "cut short": header((2, 3, 4)) + bytes(95),
}


@pytest.mark.each
@pytest.mark.parametrize("how", FORGED)
def test_a_forged_slab_is_named(tmp_path, how):
    folder = SlabFolder(tmp_path, (4, 3, 4))
    folder.save(2, np.ones((2, 3, 4), np.float32))
    (tmp_path / "00000-00002.npy").write_bytes(FORGED[how])
    with pytest.raises(CheckpointError, match=r"00000-00002\.npy.*--resume"):
        list(folder.slabs())


def test_what_is_no_file_is_no_slab(tmp_path):
    folder = SlabFolder(tmp_path, (4, 3, 4))
    kept = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    folder.save(2, kept)
    os.mkfifo(tmp_path / "00000-00002.npy")
    ((start, slab),) = folder.slabs()
    assert start == 2 and np.array_equal(slab, kept) and slab.flags.writeable
    assert folder.missing() == [slice(0, 2)]
