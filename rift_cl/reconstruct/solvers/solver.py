"""What all iterative methods have in common: steps, when to stop, and a state to go on from.

A method is a class with a record of its state, arrays and numbers; each step is a
function of that record alone, so that a run that was broken off and restored gives the same bits
as one that was not.

A run ends after so many steps, or by the discrepancy principle (Morozov 1966): once the residual's
root mean square is down to ``SAFETY`` times the noise, what is left to fit is noise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.elementwise import copy
from rift_cl.cl.host_arrays import (
    alike,
    as_device_array,
    check_output,
    download,
    finish_for_others,
    is_device_array,
)
from rift_cl.errors import CheckpointError, InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.progress import Report
from rift_cl.reconstruct.solvers.data_term import DataTerm

SAFETY = 1.0
# What rounding may make of a residual that many steps have updated, relative to the data.
_SAME_RESIDUAL = 1e-3


@dataclass
class SolverState:
    """What a method keeps between two steps; each method adds its own.

    Args:
        image: the image so far.
        residual: A image - y.
        step: steps that are done.
        rms: root mean square of the residual.
    """

    image: Any
    residual: Any
    step: int
    rms: float


class Solver(ABC):
    """An iterative method that has begun.

    Args:
        data: A, y and the weight of the residual.
        noise: standard deviation of the noise of a sample of y; None: stop by count alone.
    """

    arrays: ClassVar[tuple[int, int]]
    """Arrays of the shape of x and of the shape of y that it keeps, on the device if they fit."""
    least: ClassVar[Mapping[str, float]] = MappingProxyType({"step": 0.0})
    """The least values of numbers of its state."""
    _now: SolverState

    def __init__(self, data: DataTerm, noise: float | None) -> None:
        self.data = data
        self._target = None if noise is None else SAFETY * one_number(noise)
        self._exhausted = False

    @property
    def image(self) -> Any:
        """The image so far, an array that the next step may change.

        It is on the device, or on the host where the device has no room for it.
        """
        return self._now.image

    @property
    def residual(self) -> Any:
        """``A image - y`` so far, as the image is."""
        return self._now.residual

    @property
    def finished(self) -> bool:
        """Whether the residual is down to the noise, or no step changes the image any more."""
        met = self._target is not None and self._now.rms <= self._target
        return met or self._exhausted

    def run(self, steps: int) -> Iterator[Report]:
        """Iterate up to a total number of steps, or until the residual is down to the noise.

        Args:
            steps: in all, with those of an earlier run.

        Yields:
            A report after every step: the residual's root mean square, in the unit of y, and what
            the method knows besides.

        Raises:
            InputError: ``steps`` is no whole number >= 0.
            NonFiniteError: the data are so large that the arithmetic overflows.
        """
        total = check_steps(steps)
        while self._now.step < total and not self.finished:
            self._advance()
            if self._exhausted:
                return
            values = {"residual": self._now.rms, **self._figures()}
            yield Report(self._now.step, total, "iterations", values)

    def state(self) -> dict[str, NDArray[Any]]:
        """All that the next step depends on, as host arrays."""
        home = self.data.home
        return {
            name: home.host(value) if is_device_array(value) else np.array(value)
            for name, value in self._entries()
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what ``state`` gave, to the same bits.

        Raises:
            CheckpointError: it is not the state of this method on this A.
        """
        found = {name: np.asarray(value) for name, value in state.items()}
        entries = dict(self._entries())
        wanted = {name: _form(value) for name, value in entries.items()}
        given = {name: _form(value) for name, value in found.items()}
        if given != wanted:
            raise CheckpointError(
                f"state of another method or another A: it holds {given}, wanted {wanted}"
            )
        spoilt = [name for name, value in found.items() if not np.isfinite(value).all()]
        if spoilt:
            raise CheckpointError(f"state holds NaN or infinity in {', '.join(spoilt)}")
        low = [name for name, least in self.least.items() if found[name] < least]
        if low:
            raise CheckpointError(f"state holds {found[low[0]]} for {low[0]}: it is damaged")
        self._demand_own(found)
        for name, value in entries.items():
            if is_device_array(value):
                fresh = self.data.device.array(found[name], self.data.dtype)
                copy(self.data.device, fresh, value)
            elif isinstance(value, np.ndarray):
                np.copyto(value, found[name])
            else:
                setattr(self._now, name, type(value)(found[name]))
        self._exhausted = False

    def _demand_own(self, found: Mapping[str, NDArray[Any]]) -> None:
        """Make sure that the residual of a state is that of its image, with this A and y.

        Raises:
            CheckpointError: it is not.
        """
        data, residual = self.data, self.data.data()
        self._measured(data.home.array(found["image"]), residual)
        given = data.home.array(found["residual"])
        axpby(data.device, -1.0, residual, 1.0, given)
        size = data.rms(residual) + data.rms(data.y)
        if data.rms(given) > _SAME_RESIDUAL * size:
            raise CheckpointError("state of another A or another y: its residual is not theirs")

    def _measured(self, image: Any, out: Any) -> None:
        """``out`` = A image - y."""
        self.data.residual(image, out)

    def _entries(self) -> Iterator[tuple[str, Any]]:
        for field in fields(self._now):
            value = getattr(self._now, field.name)
            if value is not None:
                yield field.name, value

    def _figures(self) -> dict[str, float]:
        """What a report holds besides the residual."""
        return {}

    @abstractmethod
    def _advance(self) -> None:
        """Do one step, or note that none changes anything."""


def solve(solver: Solver, steps: int, *, like: Any, out: Any = None) -> Any:
    """Run a method to its end, and give the image where the data are.

    Args:
        solver: the method.
        steps: most steps.
        like: the data: the image comes to the host if they are there, as an array of their kind.
        out: array to put it into; a new one if not given.
    """
    data = solver.data
    here = not is_device_array(like)
    if out is not None and here:
        check_output(out, data.A.domain, data.dtype)
    elif out is not None:
        as_device_array(data.device, out, data.A.domain, name="out", dtype=data.dtype)
    for _ in solver.run(steps):
        pass
    if here and data.home.on_device:
        found = download(data.device, solver.image, out)
        return found if out is not None else alike(found, like)
    if out is None:
        return alike(solver.image, like) if here else solver.image
    copy(data.device, solver.image, out)
    if not here:
        finish_for_others(data.device, out)
    return out


def check_steps(steps: Any, *, name: str = "steps") -> int:
    """A number of steps.

    Raises:
        InputError: it is no whole number >= 0.
    """
    number = one_number(steps)
    if not (number >= 0 and number.is_integer()):
        raise InputError(f"{name} is {steps!r}, wanted a whole number, 0 or more")
    return int(number)


def _form(value: Any) -> tuple[tuple[int, ...], str]:
    array = value if is_device_array(value) else np.asarray(value)
    return tuple(array.shape), str(array.dtype)
