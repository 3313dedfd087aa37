"""Tensors to device arrays and back, with the checks that a person deserves.

Tensors cross by way of host memory, whatever device they are on: torch cannot share memory with
OpenCL. Results come back to the device that the arguments were on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_plain, upload
from rift_cl.errors import DeviceError, DTypeError, InputError, ShapeError


def check_tensor(
    name: str,
    value: Any,
    shape: tuple[int | None, ...],
    like: torch.Tensor | None = None,
    *,
    dtype: torch.dtype = torch.float32,
) -> torch.Tensor:
    """Check a tensor that a caller handed in.

    Args:
        name: what the caller calls it.
        value: what came.
        shape: the shape it must have; None stands for any number.
        like: a tensor on whose device it must be.
        dtype: the type it must have.

    Raises:
        DTypeError: it is no dense tensor of that type.
        ShapeError: the shape differs.
        DeviceError: it is on another device.
    """
    if not isinstance(value, torch.Tensor):
        raise DTypeError(f"{name} is a {type(value).__name__}, wanted a torch tensor")
    if value.dtype != dtype or value.layout != torch.strided:
        calls = [".to_dense()"] if value.layout != torch.strided else []
        if value.dtype != dtype:
            calls.append(".double()" if dtype == torch.float64 else ".float()")
        raise DTypeError(
            f"{name} is a {value.layout} tensor of {value.dtype}, wanted a dense {dtype}: "
            f"call {' and '.join(calls)}"
        )
    fits = len(value.shape) == len(shape) and all(
        wanted in (None, length) for length, wanted in zip(value.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise ShapeError(f"{name} has shape {tuple(value.shape)}, wanted ({wanted})")
    if value.is_meta:
        raise DeviceError(f"{name} is on the meta device, which holds no numbers")
    if like is not None and value.device != like.device:
        raise DeviceError(
            f"{name} is on {value.device} and the first tensor on {like.device}: move them to one"
        )
    return value


def to_host(tensor: torch.Tensor) -> Any:
    """A tensor's numbers as a C-ordered NumPy array, without a copy where they are one.

    Raises:
        InputError: it stands for a batch of the kind that torch had before ``torch.func``, whose
            numbers torch gives to its own functions alone.
    """
    try:
        plain = tensor.detach()
    except RuntimeError as error:
        if "Batching rule" not in str(error):
            raise
        raise InputError(
            "gradients came as a batch of the kind that torch had before torch.func "
            "(is_grads_batched=True, or vectorize=True of torch.autograd.functional): "
            "take torch.func.jacrev, jacfwd or vmap of vjp"
        ) from error
    return plain.cpu().contiguous().numpy()


def to_device(device: Device, tensor: torch.Tensor) -> Any:
    """A tensor's numbers as a device array of the same type, NaN and infinity included."""
    host = to_host(tensor)
    return upload(device, as_plain(host, host.dtype))


def to_tensor(device: Device, array: Any, like: torch.Tensor) -> torch.Tensor:
    """A device array as a tensor, where another tensor is."""
    return torch.from_numpy(np.ascontiguousarray(device.get(array))).to(like.device)
