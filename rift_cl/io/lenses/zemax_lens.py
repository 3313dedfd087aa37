"""Lens prescriptions from Zemax's ``.zmx`` files, the form in which makers publish their lenses.

A text of lines that begin with a word, in UTF-8 or UTF-16; indented lines belong to the surface
that the last ``SURF`` began. Read are sequential lenses of spheres, planes and conics (``TYPE
STANDARD``) in air; surface 0 is the object, the last one the image. Anything that would bend light
and is not understood is refused: a lens that is read is the lens that was meant. The words are
those of the program's files; they have no public specification.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError
from rift_cl.io.boundary import reading
from rift_cl.optics.glass import Glass, glass
from rift_cl.optics.lens_prescription import MOST_SURFACES, LensPrescription, Surface


@dataclass
class Line:
    """The words of one line, and where it stands."""

    where: str
    words: list[str]

    def number(self, index: int) -> float:
        """The number at a place; infinity is written as INFINITY.

        Raises:
            FileFormatError: the line is too short, or there is no finite number.
        """
        if len(self.words) <= index:
            raise FileFormatError(f"{self.where}: {' '.join(self.words)!r} ends too early")
        text = self.words[index]
        if text.upper() == "INFINITY":
            return math.inf
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise FileFormatError(
                f"{self.where}: {self.words[0]} has {reprlib.repr(text)}, wanted a finite number"
            )
        return value


def zemax_lines(path: Path, content: bytes) -> Iterator[Line]:
    """The lines of a file that are not empty; its text is UTF-8, UTF-16 or a page of letters."""
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    # Some programs leave the mark out; plain letters then have a zero after each.
    unmarked = not wide and content[1:2] == b"\0"
    try:
        text = content.decode("utf-16" if wide else "utf-16-le" if unmarked else "utf-8-sig")
    except UnicodeDecodeError:
        # Comments of older files hold letters of the writer's own code page.
        text = content.decode("latin-1")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words:
            yield Line(f"{path}: line {number}", words)


# Makers' files have some ten kilobytes.
_LARGEST_FILE = 16 << 20
_UNITS = {"MM": 1.0, "CM": 10.0, "IN": 25.4, "INCH": 25.4, "METER": 1000.0, "M": 1000.0}
_BLANK = "___BLANK"


@dataclass
class _SurfaceLines:
    """What the lines after one ``SURF`` say; lengths in the unit of the file."""

    where: str
    radius: float = math.inf
    thickness: float | None = None
    conic: float = 0.0
    semi_diameter: float | None = None
    glass: Glass | None = None
    stop: bool = False


@dataclass
class _Lens:
    """What the whole file says."""

    name: str = ""
    unit: float = 1.0
    opening: tuple[str, float] | None = None
    wavelengths: dict[int, tuple[float, float]] = field(default_factory=dict)
    count: int | None = None
    primary: int = 1
    surfaces: list[_SurfaceLines] = field(default_factory=list)


def read_zemax_lens(path: Path) -> LensPrescription:
    """Read a sequential lens from a ``.zmx`` file.

    Returns:
        The prescription in millimetres.

    Raises:
        InputError: there is no such file, a glass is unknown, a surface is of a kind that is not
            read, or the numbers are none of a lens; the error names line or surface.
        FileFormatError: the file is damaged or incomplete.
        ResourceLimitError: it is larger, or has more surfaces, than any lens.
    """
    with reading(path, "the Zemax lens"):
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ResourceLimitError(
                f"{path}: is larger than {_LARGEST_FILE >> 20} MiB, no lens is"
            )
        lens = _Lens(name=path.stem)
        for line in zemax_lines(path, content):
            _take(lens, line)
    if len(lens.surfaces) < 3:
        raise FileFormatError(
            f"{path}: has {len(lens.surfaces)} surfaces (SURF), wanted object, lens and image"
        )
    try:
        return _prescription(lens, path)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def _take(lens: _Lens, line: Line) -> None:
    """Note what a line says of the whole lens, or hand it to its surface."""
    word = line.words[0]
    if word == "SURF":
        if len(lens.surfaces) > MOST_SURFACES:
            raise ResourceLimitError(f"{line.where}: more than {MOST_SURFACES} surfaces")
        if line.number(1) != len(lens.surfaces):
            raise FileFormatError(f"{line.where}: wanted surface {len(lens.surfaces)} here")
        lens.surfaces.append(_SurfaceLines(f"surface {len(lens.surfaces)}"))
    elif word == "MODE" and line.words[1:2] != ["SEQ"]:
        raise InputError(f"{line.where}: {' '.join(line.words)}: only sequential lenses are read")
    elif word == "NAME" and len(line.words) > 1:
        lens.name = " ".join(line.words[1:])
    elif word == "UNIT":
        unit = " ".join(line.words[1:2]).upper()
        if unit not in _UNITS:
            raise FileFormatError(f"{line.where}: unit {unit!r}, wanted MM, CM, IN or METER")
        lens.unit = _UNITS[unit]
    elif word in ("ENPD", "FNUM", "FLOA", "OBNA"):
        _take_opening(lens, line)
    elif word in ("WAVM", "WAVL", "PWAV", "FTYP"):
        _take_wavelength(lens, line)
    elif lens.surfaces:
        _take_surface(lens.surfaces[-1], line)


def _take_opening(lens: _Lens, line: Line) -> None:
    kind = line.words[0]
    working = kind == "FNUM" and len(line.words) > 2 and line.number(2) != 0
    if kind == "OBNA" or working:
        raise InputError(
            f"{line.where}: {' '.join(line.words)}: the opening is read as the diameter of the "
            "entrance pupil (ENPD), the f-number of the image space (FNUM) or the stop's own "
            "(FLOA)"
        )
    lens.opening = (kind, 0.0 if kind == "FLOA" else line.number(1))


def _take_wavelength(lens: _Lens, line: Line) -> None:
    kind = line.words[0]
    if kind == "PWAV":
        lens.primary = int(min(line.number(1), 1e6))
    elif kind == "FTYP" and len(line.words) > 4:
        lens.count = int(min(line.number(4), 1e6))
    elif kind == "WAVM":
        weight = line.number(3) if len(line.words) > 3 else 1.0
        lens.wavelengths[int(min(line.number(1), 1e6))] = (line.number(2), weight)
    elif kind == "WAVL":
        for index in range(1, min(len(line.words), 25)):
            lens.wavelengths[index] = (line.number(index), 1.0)


def _take_surface(surface: _SurfaceLines, line: Line) -> None:
    word = line.words[0]
    if word == "TYPE" and line.words[1:2] != ["STANDARD"]:
        raise InputError(
            f"{line.where}: {surface.where} is of type {' '.join(line.words[1:2])!r}; only "
            "STANDARD ones are read: planes, spheres and conics about one axis"
        )
    if word == "CURV":
        curvature = line.number(1)
        surface.radius = 1 / curvature if curvature else math.inf
    elif word == "DISZ":
        surface.thickness = line.number(1)
    elif word == "CONI":
        surface.conic = line.number(1)
    elif word == "DIAM":
        surface.semi_diameter = line.number(1) or None
    elif word == "STOP":
        surface.stop = True
    elif word == "GLAS":
        try:
            surface.glass = _glass(line)
        except InputError as error:
            raise type(error)(f"{line.where}: {surface.where}: {error}") from error


def _glass(line: Line) -> Glass:
    name = " ".join(line.words[1:2])
    if name.upper() == "MIRROR":
        raise InputError("is a mirror; only lenses are read")
    # The number after the name is 1 for a model glass, whatever its name.
    if name != _BLANK and line.words[2:3] != ["1"]:
        return glass(name)
    index, abbe = line.number(4), line.number(5) if len(line.words) > 5 else 0.0
    if abbe == 0:
        return Glass(f"{index:g}", "constant", (index,))
    return Glass(f"{index:g}/{abbe:g}", "model", (index, abbe))


def _prescription(lens: _Lens, path: Path) -> LensPrescription:
    first, *between, last = lens.surfaces
    if first.glass is not None:
        raise InputError(f"{first.where}: the object lies in glass; only lenses in air are read")
    # Nothing follows the image; a file that was cut off ends in some other surface.
    if last.thickness != 0 or last.glass is not None:
        raise FileFormatError(
            f"{last.where} is the last and has a thickness or glass behind it, or no thickness "
            "(DISZ): the file ends too early, the image is missing"
        )
    stops = [index for index, surface in enumerate(between) if surface.stop]
    if len(stops) != 1:
        raise FileFormatError(f"{len(stops)} surfaces of the lens are marked STOP, wanted one")
    opening, opening_is = _opening(lens, between[stops[0]])
    # Files list 24 wavelengths, of which the first so many are meant.
    meant = lens.count or math.inf
    slots = [slot for slot in sorted(lens.wavelengths) if slot <= meant]
    if lens.primary not in slots:
        raise FileFormatError(f"the primary wavelength is number {lens.primary}, of {slots}")
    return LensPrescription(
        name=lens.name,
        surfaces=tuple(_surface(surface, lens.unit) for surface in between),
        stop=stops[0],
        opening=opening,
        opening_is=opening_is,
        wavelengths=tuple(lens.wavelengths[slot][0] * 1e-3 for slot in slots),
        weights=tuple(lens.wavelengths[slot][1] for slot in slots),
        primary=slots.index(lens.primary),
        source=path.name,
    )


def _opening(lens: _Lens, stop: _SurfaceLines) -> tuple[float, str]:
    kind, value = lens.opening or ("", 0.0)
    if kind == "FNUM":
        return value, "f_number"
    if kind == "ENPD":
        return value * lens.unit, "pupil"
    if kind == "FLOA" and stop.semi_diameter:
        return 2 * stop.semi_diameter * lens.unit, "stop"
    raise FileFormatError(
        "does not say how far the lens is open, wanted ENPD, FNUM, or FLOA and the DIAM of the stop"
    )


def _surface(lines: _SurfaceLines, unit: float) -> Surface:
    semi = lines.semi_diameter
    if lines.thickness is None:
        raise FileFormatError(f"{lines.where}: has no thickness (DISZ)")
    try:
        return Surface(
            radius=lines.radius * unit,
            thickness=lines.thickness * unit,
            glass=lines.glass,
            conic=lines.conic,
            semi_diameter=None if semi is None else semi * unit,
        )
    except InputError as error:
        raise InputError(f"{lines.where}: {error}") from error
