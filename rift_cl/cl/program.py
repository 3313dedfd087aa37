"""Launching kernels.

A ``cl.Kernel`` object holds its arguments, so two threads that share one silently compute with each
other's; each thread keeps its own. Arguments are named, and checked against what the kernel's
source says that it takes, and how long its buffers are.

A step of a fit is some fifty launches. So what can be known of a launch from the names that it
gives and from its compile-time constants is found out once (``_Launch``) and then looked up.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.build.builder import Builder, Key, building
from rift_cl.cl.build.first_launch import FirstLaunch, Way, told_launch, way_of
from rift_cl.cl.build.kernel_cache import build_lock
from rift_cl.cl.build.kernel_features import feature_of
from rift_cl.cl.build.source import kernel_source
from rift_cl.cl.failures import driver_errors, named_error, named_errors
from rift_cl.cl.grid_parts import GridPart, Size, grid_parts
from rift_cl.cl.launch_times import LaunchTimes
from rift_cl.cl.process import claim_process
from rift_cl.cl.signature import (
    Arguments,
    Signature,
    check_macros,
    check_numbers,
    signature,
)
from rift_cl.cl.watchdog import in_driver
from rift_cl.errors import DeviceError, KernelArgumentError, KernelBuildError
from rift_cl.progress import BUILDS

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# Items of a group that know of each other: the kernel's driver in Python counts in groups as well.
_COOPERATES = "get_local_id"
# Such a kernel works in smaller groups as well where its launches say of how many items they would
# like them: it then returns from groups that are one too many.
_GROUP = "GROUP"
# What a grid's lengths are given as: looked up in a set, since there is one at every launch.
_WHOLE = frozenset({int, *(np.dtype(code).type for code in np.typecodes["AllInteger"])})
_MOST_AXES = 3


@dataclass(slots=True)
class _Kernel:
    """A kernel object of one thread, what the kernel takes, and the size of its groups.

    Args:
        key: the kernel and its macros.
        program: the program that it is of, which may become another at a first launch.
        handle: the ``pyopencl.Kernel``.
        signature: what it takes.
        group: work-items of a group.
        started: ways in which any thread has launched it of this program before.
    """

    key: Key
    program: Any
    handle: Any
    signature: Signature
    group: int
    started: set[Way]


class _Launch(NamedTuple):
    """A kernel, and how what one place gives it becomes its arguments."""

    kernel: _Kernel
    arguments: Arguments


class _Place(NamedTuple):
    """A kernel with the names that a launch gives it, as they stand somewhere in the program.

    Args:
        macros: those in capitals, sorted.
        launches: by the values of the macros and their types (1 and 1.0 are other constants).
    """

    macros: tuple[str, ...]
    launches: dict[tuple[Any, ...], _Launch]


class _ThreadKernels(threading.local):
    """The calling thread's own kernel objects."""

    def __init__(self) -> None:
        self.kernels: dict[Key, _Kernel] = {}
        self.places: dict[tuple[str, ...], _Place] = {}


class Programs:
    """Every thread's kernels on one device.

    Args:
        device: the device to launch on.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._builder = Builder(device)
        self._started: dict[Any, set[Way]] = {}
        self._own = _ThreadKernels()
        seconds = device.traits.seconds
        self._times = None if seconds is None else LaunchTimes(seconds, device.finish)
        # Grids that are no longer along any axis need not be looked at.
        self._longest = min(device.traits.items) if self._times is None else 0

    @property
    def keeps_programs(self) -> bool:
        """Whether the driver keeps what it compiles in our cache folder."""
        return self._builder.keeps_programs

    @property
    def kernels(self) -> list[str]:
        """The names of the kernels that were built or loaded so far."""
        return self._builder.kernels

    def launch(self, name: str, size: tuple[int, ...], given: dict[str, Any]) -> None:
        """Enqueue one kernel over ``size`` work-items; the first axis is rounded up to groups.

        A grid that is larger than the device takes, or takes longer than it may, is enqueued in
        parts, with the same results.

        Args:
            name: the kernel, which is also its file and its entry point.
            size: work-items along each axis; nothing is enqueued when one is zero.
            given: what the kernel is given, by name. Names in capitals are the compile-time
                constants that this variant is built with. All others are the kernel's arguments,
                as its source names them: device arrays for buffers, numbers for numbers, NumPy
                arrays of 4 for ``float4``. None is no buffer, and may also be given for an
                argument that this variant does not take.

        Raises:
            KernelArgumentError: an argument is missing, unknown, of another type than the kernel
                wants, or an array that is shorter than the kernel goes through; ``size`` is no
                tuple of one to three whole numbers.
            DeviceError: ``DOUBLE`` is 1 and the device has no doubles, the kernel needs larger
                groups or more local memory than the device has, or the driver failed.
        """
        claim_process()
        if not _is_grid(size):
            raise KernelArgumentError(
                f"kernel {name}: work-items are {size!r}, and not a tuple of one to three whole "
                "numbers, none of them below zero"
            )
        if 0 in size:
            return
        kernel, arguments = self._launch_of(name, given)
        values = arguments.in_order(given, size)
        group = kernel.group
        rounded = (-(-size[0] // group) * group, *size[1:])
        local = (group,) + (1,) * (len(size) - 1)
        try:
            try:
                kernel.handle.set_args(*values)
            except RuntimeError:
                check_numbers(name, kernel.signature.parameters, values)
                raise
            if max(rounded) <= self._longest:
                self._enqueue(kernel, values, rounded, local)
                return

            def start(part: GridPart) -> None:
                self._enqueue(kernel, values, part.size, local, part.offset)

            for part in grid_parts(rounded, self._device.traits.items, group):
                if self._times is None:
                    start(part)
                else:
                    self._times.launch((kernel.key, _magnitudes(values)), part, group, start)
        except driver_errors() as error:
            raise named_error(error, f"running {name}", self._device.name) from error

    def _launch_of(self, name: str, given: dict[str, Any]) -> _Launch:
        """What is known of such a launch, found out by the calling thread's first one."""
        names = (name, *given)
        place = self._own.places.get(names)
        if place is None:
            place = _Place(tuple(sorted(filter(str.isupper, given))), {})
            self._own.places[names] = place
        constants = tuple([given[macro] for macro in place.macros])
        values = constants, tuple(map(type, constants))
        launch = place.launches.get(values)
        if launch is None:
            macros = zip(place.macros, map(literal, constants), strict=True)
            kernel = self._kernel((name, tuple(macros)))
            launch = _Launch(kernel, Arguments(kernel.signature, given))
            place.launches[values] = launch
        return launch

    def _enqueue(
        self,
        kernel: _Kernel,
        values: list[Any],
        size: Size,
        local: Size,
        offset: Size | None = None,
    ) -> None:
        import pyopencl as cl

        queue = self._device.queue
        way = way_of(size, offset)
        if way in kernel.started:
            cl.enqueue_nd_range_kernel(queue, kernel.handle, size, local, offset)
            return
        # PoCL compiles again for the first launch, and may die of it.
        name = kernel.key[0]
        taken = [each.dtype if each.lanes else None for each in kernel.signature.parameters]
        launch = told_launch(size, local, offset, zip(taken, values, strict=True))
        with building, build_lock(name), BUILDS.of(name):
            self._renew(kernel, values, launch)
            with self._builder.first_launch(kernel.key, launch):
                cl.enqueue_nd_range_kernel(queue, kernel.handle, size, local, offset)
                with in_driver(f"running {name}", self._device.name):
                    queue.finish()
            kernel.started.add(way)

    def _renew(self, kernel: _Kernel, values: list[Any], launch: FirstLaunch) -> None:
        """Give a kernel the program that can be launched so, where that is another."""
        program = self._builder.launchable(kernel.key, launch)
        if program is not kernel.program:
            kernel.program = program
            kernel.handle = self._handle(program, kernel.key[0], kernel.signature)
            kernel.handle.set_args(*values)
            kernel.started = self._started.setdefault(program, set())

    def _kernel(self, key: Key) -> _Kernel:
        kernel = self._own.kernels.get(key)
        if kernel is None:
            asked = dict(key[1]).get(_GROUP, self._device.traits.macros[_GROUP])
            kernel = self._own.kernels[key] = self._built(key, int(asked))
        return kernel

    def _built(self, key: Key, group: int) -> _Kernel:
        """A kernel in groups of ``group``, or of half as many items where these are too many.

        Raises:
            DeviceError: its groups are too large, or take too much local memory, in a kernel that
                is not made for smaller ones.
        """
        name, macros = key
        program = self._builder.program(key)
        with building, named_errors(f"loading kernel {name}", self._device.name):
            found = self._signature(name, macros)
            handle = self._handle(program, name, found)
            needs = kernel_needs(handle, self._device._handle)
        fault = self._fault(needs, group)
        if fault is None:
            started = self._started.setdefault(program, set())
            return _Kernel(key, program, handle, found, group, started)
        fixed = _COOPERATES in kernel_source(name) and _GROUP not in dict(macros)
        if group == 1 or fixed:
            raise DeviceError(f"{feature_of(name)}: {fault}: use another device (--device)")
        smaller = {**dict(macros), _GROUP: str(group // 2)}
        return self._built((name, tuple(sorted(smaller.items()))), group // 2)

    def _signature(self, name: str, macros: Any) -> Signature:
        source = kernel_source(name)
        check_macros(name, source, [macro for macro, _ in macros])
        try:
            return signature(name, source, self._builder.defines(macros))
        except ValueError as error:
            raise KernelBuildError(f"kernel {name}: {error}") from error

    def _handle(self, program: Any, name: str, taken: Signature) -> Any:
        import pyopencl as cl

        handle = cl.Kernel(program, name)
        # Numbers whose types are known beforehand are set many times faster.
        handle.set_scalar_arg_dtypes(
            [each.dtype.type if each.lanes == 1 else None for each in taken.parameters]
        )
        return handle

    def _fault(self, needs: KernelNeeds, group: int) -> str | None:
        """Why a kernel does not run on this device in groups of so many items; None if it does."""
        there, device = self._device.traits.local_memory, self._device.name
        if needs.local_memory > there:
            return (
                f"needs {format_bytes(needs.local_memory)} of local memory, "
                f"{device} has {format_bytes(there)}"
            )
        if needs.group < group:
            return (
                f"works in groups of {group} work-items, and {device} runs it in groups of at most "
                f"{needs.group}"
            )
        return None


def _is_grid(size: Any) -> bool:
    return (
        type(size) is tuple
        and 0 < len(size) <= _MOST_AXES
        and _WHOLE.issuperset(map(type, size))
        and min(size) >= 0
    )


def _magnitudes(values: Iterable[Any]) -> tuple[int, ...]:
    """Binary digits of the whole numbers that a kernel is given: most loops are as long as one."""
    return tuple(int(v).bit_length() for v in values if isinstance(v, (int, np.integer)))


class KernelNeeds(NamedTuple):
    """What a driver says of a kernel that it built.

    Args:
        group: most work-items of a group that it can run in.
        local_memory: bytes of local memory that a group takes.
    """

    group: int
    local_memory: int


def kernel_needs(kernel: Any, device: Any) -> KernelNeeds:
    """What the driver of a ``pyopencl.Device`` says of a ``pyopencl.Kernel``."""
    import pyopencl as cl

    asked = cl.kernel_work_group_info
    found = (asked.WORK_GROUP_SIZE, asked.LOCAL_MEM_SIZE)
    return KernelNeeds(*(kernel.get_work_group_info(info, device) for info in found))


def literal(value: float | str) -> str:
    """A compile-time constant as the compiler sees it; a text is an expression without spaces."""
    if isinstance(value, str):
        return value
    return f"{float(value)!r}f" if isinstance(value, (float, np.floating)) else str(int(value))
