"""The errors a person may meet, each with the exit status that the command line gives it.

One sentence says what was wrong, where, and what to do about it. Anything else that escapes from
the package is a defect of the package.
"""

from __future__ import annotations

import numbers
import reprlib
import typing
from collections import abc

_NUMBERS = (numbers.Real, numbers.Integral)
# What is of a type by Python's reckoning and not by anybody else's.
_NOT_MEANT: dict[type, type | tuple[type, ...]] = {
    numbers.Real: bool,
    numbers.Integral: bool,
    abc.Sequence: (str, bytes),
    abc.Iterable: (str, bytes),
}
# Of what a person may not know where to get it, by the name of the type.
_FROM = {"Device": 'a Device, which rift.open_device("cpu") gives'}
_IN_WORDS: dict[type, str] = {
    numbers.Real: "a number",
    numbers.Integral: "a whole number",
    abc.Sequence: "a list",
    abc.Iterable: "a list",
    abc.Mapping: "values by name (a dict)",
    str: "a text",
}


class RiftError(Exception):
    """Every error that RiFT-CL raises on purpose."""

    exit_status = 1


class InputError(RiftError, ValueError):
    """An argument or a file holds something that cannot be used."""

    exit_status = 3


class SettingError(InputError):
    """A field of a dataclass of settings has a value that it does not take.

    Args:
        settings: the dataclass, an instance or its name.
        name: of the field.
        said: what is said of it, such as "is 'l3', wanted l1 or l2".
    """

    def __init__(self, settings: object, name: str, said: str) -> None:
        owner = settings if isinstance(settings, str) else type(settings).__name__
        super().__init__(f"{owner}: {name} {said}")
        self.settings, self.name, self.said = owner, name, said

    def __reduce__(self) -> tuple[type[SettingError], tuple[str, str, str]]:
        """Travel between processes as what was said."""
        return SettingError, (self.settings, self.name, self.said)


class ShapeError(InputError):
    """An array has the wrong shape."""


class DTypeError(InputError, TypeError):
    """An array has a type that has no meaning here."""


class WrongTypeError(InputError, TypeError):
    """An argument is of a type that has no meaning there."""


class BasisSpanError(InputError):
    """A function of one basis was wanted in another that does not hold it."""


class NonFiniteError(InputError):
    """An array holds NaN or infinity."""


class FileFormatError(InputError):
    """A file is damaged, or is not what it was taken for."""


class PathEscapeError(InputError):
    """A path found inside a file leads outside that file's folder."""


class ResourceLimitError(InputError):
    """A file or request claims more than the budget allows; nothing was allocated."""


class GivenUpError(InputError, AttributeError):
    """A part of something is asked for that was given up to save memory."""


class CheckpointError(InputError):
    """A checkpoint is damaged or belongs to another run."""


class StoppedError(RiftError):
    """A person broke a run off; what was done so far is kept."""

    exit_status = 130


class DeviceError(RiftError, RuntimeError):
    """Something is wrong with the OpenCL device or its driver."""

    exit_status = 4


class NoDeviceError(DeviceError):
    """No OpenCL device answers the request."""


class DeviceLostError(DeviceError):
    """The device stopped answering."""


class DeviceMemoryError(DeviceError, MemoryError):
    """The device has too little memory, whatever the chunk size."""


class ClusterError(RiftError, RuntimeError):
    """The workers that work was given to cannot do it."""

    exit_status = 4


class KernelArgumentError(RiftError, TypeError):
    """A kernel was launched with arguments that it does not take."""


class KernelBuildError(DeviceError):
    """A kernel did not compile."""


class ForkedContextError(DeviceError):
    """OpenCL was used in a process that was forked from one that had already used it."""


class OutputError(RiftError, OSError):
    """A result could not be written; nothing half-written was left behind."""

    exit_status = 5


# What photographs and videos want beyond the package itself, installed from its folder.
INSTALL = "pip install '.[capture,heic,film,view]'"


def not_installed(what: str, package: str, alone: str, instead: str = "") -> InputError:
    """The error where a package is missing that photographs want; all of them say it alike.

    Args:
        what: what it does, such as "a.mp4: videos are read by".
        package: as people call it.
        alone: its requirement, for whoever wants no other.
        instead: what can be done without it.
    """
    return InputError(
        f"{what} {package}, which is not installed: {INSTALL} in the folder of the repository, "
        f"or pip install {alone}{instead and f'; or {instead}'}"
    )


def checked_flag(where: str, name: str, value: object) -> bool:
    """A truth value, given as one: of words, "no" is as true as any other.

    Args:
        where: what takes it.
        name: of the argument.
        value: what was given.

    Raises:
        InputError: it is none.
    """
    one: typing.Any = value
    if getattr(one, "shape", None) == ():
        one = one.item()
    if not isinstance(one, bool):
        raise InputError(f"{where}: {name} is {reprlib.repr(value)}, wanted True or False")
    return one


def check_type(where: str, name: str, value: object, wanted: type) -> None:
    """Refuse an argument of another type by name, before something looks for its parts.

    Args:
        where: what takes it.
        name: of the argument.
        value: what was given.
        wanted: its type.

    Raises:
        WrongTypeError: it is of another.
    """
    one: typing.Any = value
    if wanted in _NUMBERS and getattr(one, "shape", None) == ():
        # An array without axes is a number.
        one = one.item()
    passes_by_chance = isinstance(one, _NOT_MEANT.get(wanted, ()))
    if passes_by_chance or not isinstance(one, wanted):
        raise WrongTypeError(
            f"{where}: {name} is {reprlib.repr(value)} (type {type(value).__name__}), wanted "
            f"{_IN_WORDS.get(wanted) or _FROM.get(wanted.__name__, wanted.__name__)}"
        )
