"""Building kernels: the only caller of the driver's compiler.

A program is built once per device, kernel and macros, and first in a child process
(``guarded_build``): a compiler that dies or hangs does not take this process with it. What came of
it is kept in a store of our own (``program_store``), with the binary; a driver that keeps what it
compiles in our cache folder, as PoCL does, finds there what the child's has compiled. Drivers may
compile again for a first launch, which the child therefore does before this process. Where one died
of either all the same, the next keeps the binary in the store for such a driver too.
"""

from __future__ import annotations

import contextlib
import re
import threading
import time
import warnings
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rift_cl.cl.build.driver_record import OTHER_KIND, keeps_programs, read_record
from rift_cl.cl.build.first_launch import FirstLaunch, way_of
from rift_cl.cl.build.guarded_build import (
    UNOPTIMIZED,
    Request,
    guarded_build,
    guarded_launch,
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
_PAUSES = (0.1, 0.3)
_DOUBLE = ("DOUBLE", "1")


class _Recipe(NamedTuple):
    """What a program is compiled from.

    Args:
        entry: its name in the store.
        key: the kernel and its macros.
        source: with the includes in line.
        options: what the compiler is given.
    """

    entry: str
    key: Key
    source: str
    options: list[str]


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
        self._recipes: dict[Key, _Recipe] = {}
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

    def launchable(self, key: Key, launch: FirstLaunch) -> Any:
        """The program to launch in a way that is new to this process; hold the kernel's lock.

        Where the driver would compile for it, a child launches it before. If its compiler dies of
        that, the program is another from then on, built with a workaround.

        Raises:
            KernelBuildError: there is no way in which it can be launched.
        """
        recipe = self._recipes[key]
        stored = load(recipe.entry) if self.keeps_programs else None
        way = list(way_of(launch["size"], launch["offset"]))
        if stored is None or stored.binary or way in stored.about["launched"]:
            return self._programs[key]
        about = stored.about
        fault = guarded_launch(self._request(recipe, about["way"], [launch]))
        if not fault:
            about = {**about, "launched": [*about["launched"], way]}
            save(recipe.entry, Stored(about, b""))
        else:
            found = {**about, "launches": [*about["launches"], launch]}
            self._programs[key] = self._guarded(recipe, found, binary=False)
        return self._programs[key]

    def first_launch(self, key: Key, launch: FirstLaunch) -> AbstractContextManager[None]:
        """Mark a built program while it is first launched, which some drivers compile for.

        The next process knows of it if this one dies of it; hold the kernel's lock.
        """
        return begun(self._recipes[key].entry, launch)

    def _build(self, key: Key) -> Any:
        name, macros = key
        if _DOUBLE in macros:
            real_type(self._device, np.float64)
        defines = self.defines(macros).items()
        optimized = () if self._device.traits.optimized else (UNOPTIMIZED,)
        options = [*OPTIONS, *optimized, *(f"-D{macro}={value}" for macro, value in defines)]
        source, options = way_to_build(self._known.get("way", ""), kernel_source(name), options)
        entry = program_name(self._driver, source, options)
        recipe = self._recipes[key] = _Recipe(entry, key, source, options)
        if key in self._refused:
            raise KernelBuildError(self._refused[key])
        # It is found out under a lock of its own, the first time.
        keeps = self.keeps_programs
        # The first launch, which compiles as well, writes down what both left.
        with build_lock(name, write_down=False):
            return self._stored(recipe, keeps)

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

    def _stored(self, recipe: _Recipe, keeps: bool) -> Any:
        """A program of the store, which a child process compiles where it is not there yet."""
        import pyopencl as cl

        died_of = unfinished(recipe.entry)
        stored = load(recipe.entry)
        kept = stored.about if stored else {}
        if stored is not None and is_settled(kept) and died_of is None:
            # A driver need not take what it gave; then it compiles again.
            with contextlib.suppress(cl.Error):
                return self._loaded(recipe, stored)
            remove(recipe.entry)
        launches = [*kept.get("launches", []), *(died_of or [])]
        binary = not keeps or died_of is not None or bool(stored and stored.binary)
        return self._guarded(recipe, {**kept, "launches": launches}, binary)

    def _guarded(self, recipe: _Recipe, kept: dict[str, Any], binary: bool) -> Any:
        """A program that a child process compiles, stored if nothing else had a hand in it.

        Args:
            recipe: what it is compiled from.
            kept: what the store says of it, and the launches that processes died of.
            binary: whether the store is to keep the binary.
        """
        name, macros = recipe.key
        device, launches = self._device, kept["launches"]
        built = guarded_build(self._request(recipe, "", launches, binary))
        there = built.binary is not None
        if built.passing and not there:
            raise KernelBuildError(
                f"kernel {name} was not compiled for {device.name}: {built.fault}, for a reason "
                "that may pass; see that there is memory and that nothing ends processes, and try "
                "again"
            )
        if built.log and not there:
            raise _build_error(name, built.log, recipe.options, device.name)
        about = {"kernel": name, "macros": dict(macros), "driver": self._driver, "built": there}
        about |= {"way": built.way, "fault": built.fault, "launches": launches}
        about["launched"] = [way_of(each["size"], each["offset"]) for each in launches]
        if not there:
            met = 0 if kept.get("built", True) else kept.get("met", 0)
            about |= {"met": met + 1, "when": time.time()}
        stored = Stored(about, built.binary or b"")
        if not built.passing:
            save(recipe.entry, stored)
        with named_errors(f"loading kernel {name}", device.name):
            return self._loaded(recipe, stored)

    def _request(
        self, recipe: _Recipe, way: str, launches: list[FirstLaunch], binary: bool = False
    ) -> Request:
        source, options = way_to_build(way, recipe.source, recipe.options)
        device = self._device
        return Request(
            device.selector, device.name, recipe.key[0], source, options, launches, binary
        )

    def _loaded(self, recipe: _Recipe, stored: Stored) -> Any:
        """The program that a file of the store stands for.

        Raises:
            KernelBuildError: it stands for a kernel that this driver cannot build.
        """
        import pyopencl as cl

        device, about, key = self._device, stored.about, recipe.key
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
        if stored.binary:
            return cl.Program(context, context.devices, [stored.binary]).build()
        # The driver has it in its cache, or gives no binaries; the child saw that it compiles.
        return self._compiled(recipe, about["way"])

    def _compiled(self, recipe: _Recipe, way: str) -> Any:
        """A program that the driver compiles in this process, or takes from a cache of its own."""
        import pyopencl as cl

        source, options = way_to_build(way, recipe.source, recipe.options)
        pauses = iter(_PAUSES)
        while True:
            try:
                with begun(recipe.entry):
                    return cl.Program(self._device.context, source).build(options)
            except cl.Error as error:
                # An empty log is PoCL's way to lose a race for its cache; a real error has one.
                pause = next(pauses, None)
                if pause is None or _log(str(error)):
                    raise
                time.sleep(pause)


def _log(text: str) -> str:
    lines = [
        line
        for line in text.splitlines()
        if re.search(r"(error|warning)\b *:", line, re.IGNORECASE)
    ]
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
