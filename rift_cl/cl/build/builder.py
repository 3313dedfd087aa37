"""Building kernels: the only caller of the driver's compiler.

A program is built once per device, kernel and macros. A driver that keeps what it compiles in our
cache folder, as PoCL does, compiles in this process, but for kernels that it died of before. For
any other the binaries are kept by us (``program_store``), and a child process compiles them
(``guarded_build``): a compiler that dies or hangs does not take this process with it. Where a
process died of a first launch, which drivers compile for as well, the child repeats that launch.
"""

from __future__ import annotations

import contextlib
import re
import threading
import time
import warnings
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rift_cl.cl.build.driver_record import OTHER_KIND, keeps_programs, read_record
from rift_cl.cl.build.first_launch import FirstLaunch
from rift_cl.cl.build.guarded_build import (
    UNOPTIMIZED,
    Request,
    guarded_build,
    way_to_build,
)
from rift_cl.cl.build.kernel_cache import build_lock
from rift_cl.cl.build.kernel_features import feature_of
from rift_cl.cl.build.program_store import (
    Stored,
    begun,
    is_settled,
    load,
    program_name,
    remove,
    save,
    unfinished,
)
from rift_cl.cl.build.source import fault_place, kernel_source
from rift_cl.cl.failures import named_errors
from rift_cl.cl.real_type import real_type
from rift_cl.errors import DeviceError, KernelBuildError
from rift_cl.progress import BUILDS

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-w")
# One for all devices: pyopencl writes Python code for each new kernel, and that is not thread-safe.
building = threading.RLock()
# A kernel and its macros as the compiler sees them: 1 and 1.0 are equal, but not the same.
Key = tuple[str, tuple[tuple[str, str], ...]]
_PAUSES = (0.0, 0.1, 0.3)
_DOUBLE = ("DOUBLE", "1")


class Builder:
    """The built programs of one device.

    Args:
        device: the device to build for.
    """

    def __init__(self, device: Device) -> None:
        # Some drivers remark on kernels that they build well; a failure is told by an exception.
        warnings.filterwarnings("ignore", message="Non-empty compiler output")
        self._device = device
        self._programs: dict[Key, Any] = {}
        self._entries: dict[Key, str] = {}
        self._refused: dict[Key, str] = {}

    def defines(self, macros: tuple[tuple[str, str], ...]) -> dict[str, str]:
        """Every macro that a program is built with."""
        device = {macro: str(value) for macro, value in self._device.traits.macros.items()}
        return device | dict(macros)

    @property
    def kernels(self) -> list[str]:
        """The names of the kernels that were built or loaded so far."""
        return sorted({name for name, _ in self._programs})

    def program(self, key: Key) -> Any:
        """The ``pyopencl.Program`` of a kernel and its macros, built by the first who asks.

        Raises:
            KernelBuildError: it does not compile; or it was not compiled for a reason that may
                pass, such as memory, and whoever asks again tries again.
            DeviceError: this driver computes wrong numbers with it, or ``DOUBLE`` is 1 and the
                device has no doubles.
        """
        with building:
            if key not in self._programs:
                self._check_known(key[0])
                with BUILDS.of(key[0]):
                    self._programs[key] = self._build(key)
            return self._programs[key]

    def first_launch(self, key: Key, launch: FirstLaunch) -> AbstractContextManager[None]:
        """Mark a built program while it is first launched, which some drivers compile for.

        The next process leaves it to a child if this one dies of it; hold the build lock.
        """
        return begun(self._entries[key], launch)

    def _build(self, key: Key) -> Any:
        name, macros = key
        if _DOUBLE in macros:
            real_type(self._device, np.float64)
        defines = self.defines(macros).items()
        optimized = () if self._device.traits.optimized else (UNOPTIMIZED,)
        options = [*OPTIONS, *optimized, *(f"-D{macro}={value}" for macro, value in defines)]
        source, options = way_to_build(self._known.get("way", ""), kernel_source(name), options)
        entry = self._entries[key] = program_name(self._driver, source, options)
        if self.keeps_programs:
            program = self._compiled(entry, name, source, options)
            if program is not None:
                return program
        return self._stored(entry, key, source, options)

    @cached_property
    def _driver(self) -> dict[str, str]:
        return self._device.identity

    @property
    def _known(self) -> dict[str, Any]:
        """What the last test of this driver left behind, if there was one."""
        return read_record(self._driver)

    @cached_property
    def keeps_programs(self) -> bool:
        """Whether the driver keeps what it compiles in our cache folder."""
        return keeps_programs(self._driver, self._device.context)

    def _check_known(self, name: str) -> None:
        known = self._known
        if known.get("way") == OTHER_KIND and not self._device.in_other_guise:
            raise DeviceError(
                f"{self._device.name} is right with the {OTHER_KIND} alone, as the test of its "
                "driver has just found: start again, and they are used"
            )
        said = known.get("refused", {}).get(name)
        if said is not None:
            device = self._device
            raise DeviceError(
                f"{feature_of(name)}: refused on {device.name} ({device.platform}, driver "
                f"{device.driver}), which failed its test: {said}; use another device (--device) "
                "or another version of the driver ('rift devices --retest' tests it again)"
            )

    def _compiled(self, entry: str, name: str, source: str, options: list[str]) -> Any:
        """A program that the driver compiles in this process, or takes from a cache of its own.

        None where a process once died of it: a child compiles it, or did so.
        """
        import pyopencl as cl

        failure = ""
        for pause in _PAUSES:
            time.sleep(pause)
            try:
                # Its first launch, which compiles as well, writes down what both left.
                with build_lock(name, write_down=False):
                    if unfinished(entry) is not None or load(entry) is not None:
                        return None
                    with begun(entry):
                        return cl.Program(self._device.context, source).build(options)
            except cl.Error as error:
                failure = str(error)
            # An empty log is PoCL's way to lose a race for its cache; a real error has one.
            if _log(failure):
                break
        raise _build_error(name, failure, options, self._device.name)

    def _stored(self, entry: str, key: Key, source: str, options: list[str]) -> Any:
        """A program of our own store, which a child process compiles where it is not there yet."""
        import pyopencl as cl

        name = key[0]
        if key in self._refused:
            raise KernelBuildError(self._refused[key])
        with build_lock(name, write_down=False):
            died_of = unfinished(entry) or []
        stored = load(entry)
        kept = stored.about if stored else {}
        launches = [*kept.get("launches", []), *died_of]
        if stored is not None and is_settled(kept) and not died_of:
            # A driver need not take what it gave; then it compiles again.
            with contextlib.suppress(cl.Error):
                return self._loaded(key, stored, source, options)
            remove(entry)
        stored = self._guarded(entry, key, source, options, {**kept, "launches": launches})
        with named_errors(f"loading kernel {name}", self._device.name):
            return self._loaded(key, stored, source, options)

    def _guarded(
        self, entry: str, key: Key, source: str, options: list[str], kept: dict[str, Any]
    ) -> Stored:
        """A program that a child process compiles, stored if nothing else had a hand in it.

        Args:
            entry: its name in the store.
            key: the kernel and its macros.
            source: with what its way of building wants.
            options: the same.
            kept: what the store says of it, and the launches that processes died of.
        """
        name, macros = key
        device, launches = self._device, kept["launches"]
        request = Request(device.selector, device.name, name, source, options, launches)
        built = guarded_build(request)
        there = built.binary is not None
        if built.passing and not there:
            raise KernelBuildError(
                f"kernel {name} was not compiled for {device.name}: {built.fault}, for a reason "
                "that may pass; see that there is memory and that nothing ends processes, and try "
                "again"
            )
        if built.log and not there:
            raise _build_error(name, built.log, options, device.name)
        about = {"kernel": name, "macros": dict(macros), "driver": self._driver, "built": there}
        about |= {"way": built.way, "fault": built.fault, "launches": launches}
        if not there:
            met = 0 if kept.get("built", True) else kept.get("met", 0)
            about |= {"met": met + 1, "when": time.time()}
        stored = Stored(about, built.binary or b"")
        if not built.passing:
            save(entry, stored)
        return stored

    def _loaded(self, key: Key, stored: Stored, source: str, options: list[str]) -> Any:
        """The program that a file of the store stands for.

        Raises:
            KernelBuildError: it stands for a kernel that this driver cannot build.
        """
        import pyopencl as cl

        device, about = self._device, stored.about
        if not about["built"]:
            macros = " ".join(f"{macro}={value}" for macro, value in about["macros"].items())
            again = "'rift devices --retest'" if is_settled(about) else "the next start"
            self._refused[key] = (
                f"{feature_of(key[0])}: {device.name} ({device.platform}, driver {device.driver}) "
                f"cannot build it ({macros}): {about['fault']}, and no workaround helped; use "
                f"another device (--device) or another version of the driver ({again} tries again)"
            )
            raise KernelBuildError(self._refused[key])
        context = device.context
        if not stored.binary:
            # The driver gives no binaries; the child saw that it compiles.
            source, options = way_to_build(about["way"], source, options)
            return cl.Program(context, source).build(options)
        return cl.Program(context, context.devices, [stored.binary]).build()


def _log(text: str) -> str:
    lines = [line for line in text.splitlines() if re.search(r"error|warning", line, re.IGNORECASE)]
    return "\n".join(line for line in lines if "BUILD_PROGRAM_FAILURE" not in line)


def _build_error(name: str, text: str, options: list[str], device: str) -> KernelBuildError:
    log = _log(text)
    where = fault_place(name, log)
    return KernelBuildError(
        f"kernel {name} did not compile for {device}, at {where}; if neither the kernel nor "
        "an expression in it, such as a loss, is yours, this is a defect of rift-cl or of the "
        f"driver: please report it with this log (options {' '.join(options)}):\n"
        f"{log or text}"
    )
