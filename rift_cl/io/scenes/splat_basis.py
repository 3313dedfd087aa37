"""What a file of splats says of modes, lobes and shared light: properties of our own, and comments.

Splats of a higher order (see ``rift_cl.splat.splats``) keep in a PLY file all that other programs
look for, their constants, and after it

    shape_0 ..    the modes of the shape, in graded order without the constant,
    tint_0 ..     those of the colour, channel by channel as f_rest is,
    lobe_0 ..     the geometry of the lobes that colours vary in, in place of harmonics,
    angular_0 ..  the lobes' coefficients but the first, which is f_dc, channel by channel,
    reflectance_0 .. 6  how splats reflect an environment light, about the normal nx ny nz.

A comment says what they are: ``rift-cl basis: shape order 2, color order 1, activation exp, angular
lg, environment 128``, with whatever differs from plain splats. It must agree with the properties; a
file that has them without it is refused, since it would be drawn as something else. The light
itself is in further comments, ``rift-cl light: -1.5 -1.5 -1.5``, one for each lobe in their order
(``rift_cl.basis.angular.environment``): natural logarithms of red, green and blue radiance.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular import ANGULAR_BASES, AngularBasis, angular_basis
from rift_cl.basis.angular.environment import MOST_LOBES, REFLECTANCE
from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.splat.orders import HIGHEST, count_of, order_of
from rift_cl.splat.settings import Activation

_MARK, _LIGHT = "rift-cl basis:", "rift-cl light:"
_FAMILIES = ("shape", "tint", "lobe", "angular", "reflectance")
_FAMILY = re.compile(rf"({'|'.join(_FAMILIES)})_[0-9]+")
_PART = re.compile(r"(shape order|color order|activation|angular|environment) ([a-z0-9]+)")
_LOBES = re.compile(r"[1-9][0-9]{0,3}")
_SHOWN = 60

Columns = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class SceneBasis:
    """What a scene has beside Gaussians of one colour in spherical harmonics.

    Args:
        shape_order: of the modes of the shape, 0 for none.
        color_order: of those of the colour.
        activation: how densities become opacities; see ``SplatSettings``.
        angular: what colours vary in; see ``SplatSettings``.
        linear: coefficients of a channel's lobes, the constant among them; 0 with harmonics.
        environment: lobes of an environment light that splats share; 0 without one.
    """

    shape_order: int = 0
    color_order: int = 0
    activation: Activation = "clamp"
    angular: str = "sh"
    linear: int = 0
    environment: int = 0

    @classmethod
    def of(cls, scene: Any) -> SceneBasis:
        """That of a ``SplatScene``, whose arrays are checked against each other.

        Raises:
            InputError: a choice is unknown, or belongs to no scene of this mode.
            ShapeError: a number of modes, or of lobes, does not exist.
        """
        kinds = ("activation", get_args(Activation)), ("angular", ANGULAR_BASES.names)
        for name, choices in kinds:
            if getattr(scene, name) not in choices:
                wanted = " or ".join(choices)
                raise InputError(f"SplatScene: {name} is {getattr(scene, name)!r}, wanted {wanted}")
        linear = 0 if scene.angular == "sh" else (*np.shape(scene.sh), 0, 0)[1]
        orders = [_order_of(scene, name) for name in ("shape_modes", "color_modes")]
        light = 0 if scene.environment is None else len(scene.environment)
        if light > MOST_LOBES:
            raise ShapeError(f"SplatScene: environment has {light} lobes, wanted 1 to {MOST_LOBES}")
        found = cls(orders[0], orders[1], scene.activation, scene.angular, linear, light)
        if scene.mode == "xray" and found != cls(shape_order=orders[0]):
            raise InputError(
                "SplatScene: splats of X-rays have neither colours nor an activation: leave out "
                "color_modes, lobes and the rest"
            )
        return found

    @property
    def _lobes(self) -> AngularBasis | None:
        return angular_basis(self.angular, self.linear) if self.linear else None

    @property
    def plain(self) -> bool:
        """Whether there is nothing to say."""
        return self == SceneBasis()

    @property
    def words(self) -> str:
        """What there is, in the words of a header's comment."""
        parts = [f"shape order {self.shape_order}"] if self.shape_order else []
        parts += [f"color order {self.color_order}"] if self.color_order else []
        parts += [f"activation {self.activation}"] if self.activation != "clamp" else []
        parts += [f"angular {self.angular}"] if self.angular != "sh" else []
        parts += [f"environment {self.environment}"] if self.environment else []
        return ", ".join(parts)

    @property
    def named(self) -> str:
        """What there is, in the words of an error."""
        other = replace(self, environment=0).words
        parts = [other] if other else []
        parts += ["environment light"] if self.environment else []
        return ", ".join(parts)

    @property
    def comment(self) -> str:
        """The line of a header that says it."""
        return f"comment {_MARK} {self.words}"

    @property
    def lengths(self) -> dict[str, int]:
        """How many properties each family has."""
        return {
            "shape": count_of(self.shape_order) - 1,
            "tint": 3 * (count_of(self.color_order) - 1),
            "lobe": self._lobes.n_geometry if self._lobes else 0,
            "angular": 3 * (self.linear - 1) if self.linear else 0,
            "reflectance": REFLECTANCE if self.environment else 0,
        }

    @property
    def numbers(self) -> int:
        """Properties of all families, and normals where they mean something, for each splat."""
        return sum(self.lengths.values()) + (3 if self.environment else 0)

    def shapes(self, count: int) -> dict[str, tuple[int, ...]]:
        """The shapes of the arrays that there are, by their names."""
        shape, color = count_of(self.shape_order) - 1, count_of(self.color_order) - 1
        found: dict[str, tuple[int, ...]] = {"shape_modes": (count, shape)} if shape else {}
        found |= {"color_modes": (count, color, 3)} if color else {}
        found |= {"lobes": (count, self.lengths["lobe"])} if self.linear else {}
        if self.environment:
            found |= {"normals": (count, 3), "reflectance": (count, REFLECTANCE)}
            found["environment"] = (self.environment, 3)
        return found

    def columns(self, arrays: Mapping[str, Any]) -> Columns:
        """Views of the arrays by the names of the properties, in the order of the file."""
        found: Columns = {}
        tables = ("shape", "shape_modes"), ("lobe", "lobes"), ("reflectance", "reflectance")
        for family, name in tables:
            for k in range(self.lengths[family]):
                found[f"{family}_{k}"] = arrays[name][:, k]
        if self.color_order:
            found |= _by_channel("tint", arrays["color_modes"])
        if self.linear:
            found |= _by_channel("angular", arrays["sh"][:, 1:])
        return found


def read_basis(path: Path, comments: Sequence[str], properties: Mapping[str, str]) -> SceneBasis:
    """What a header says of its splats' basis; compared with its properties.

    Raises:
        FileFormatError: it says something that has no meaning, or contradicts the properties.
    """
    said = [line[len(_MARK) :].strip() for line in comments if line.startswith(_MARK)]
    families = dict.fromkeys(_FAMILIES, 0)
    for name in properties:
        if _FAMILY.fullmatch(name):
            families[name.split("_")[0]] += 1
    if len(said) != 1:
        _demand_nothing(path, families, said)
        return SceneBasis()
    basis = _parsed(path, said[0], families["angular"])
    wrong = [name for name, count in families.items() if count != basis.lengths[name]]
    if wrong:
        name = wrong[0]
        raise FileFormatError(
            f"{path}: has {families[name]} properties {name}_0.., but its comment says "
            f"{said[0][:_SHOWN]!r}, which has {basis.lengths[name]}; the file is damaged"
        )
    return basis


def light_comments(environment: NDArray[np.float32]) -> list[str]:
    """The lines of a header that hold a light, to the bit."""
    rows = (" ".join(f"{value:.9g}" for value in row) for row in environment.tolist())
    return [f"comment {_LIGHT} {row}" for row in rows]


def read_light(path: Path, comments: Sequence[str], count: int) -> NDArray[np.float32]:
    """The light of ``count`` lobes that a header's comments hold, (K, 3).

    Raises:
        FileFormatError: there are other than so many, or one is no light.
    """
    rows = [line[len(_LIGHT) :] for line in comments if line.startswith(_LIGHT)]
    try:
        # Words that are no finite numbers are met here, or as NaN and infinity by the reader.
        found = np.array([[float(word) for word in row.split()] for row in rows], np.float32)
    except ValueError:
        found = np.empty((0, 0), np.float32)
    if found.shape != (count, 3):
        raise FileFormatError(
            f"{path}: its comments '{_LIGHT}' hold no {count} lobes of red, green and blue, as its "
            "environment light has; the file is damaged"
        )
    return found


def _by_channel(family: str, table: Any) -> Columns:
    each = table.shape[1]
    return {f"{family}_{c * each + k}": table[:, k, c] for c in range(3) for k in range(each)}


def _order_of(scene: Any, name: str) -> int:
    modes = getattr(scene, name)
    if modes is None:
        return 0
    shape = np.shape(modes)
    wanted = "(N, K - 1)" if name == "shape_modes" else "(N, K - 1, 3)"
    if len(shape) == 2 + (name == "color_modes"):
        try:
            return order_of(shape[1] + 1)
        except InputError as error:
            raise ShapeError(f"SplatScene: {name}: {error} (the first is not stored)") from error
    raise ShapeError(f"SplatScene: {name} has shape {shape}, wanted {wanted}")


def _demand_nothing(path: Path, families: Mapping[str, int], said: Sequence[str]) -> None:
    if said:
        raise FileFormatError(f"{path}: has {len(said)} comments '{_MARK}', wanted one")
    found = next((name for name, count in families.items() if count), None)
    if found is not None:
        raise FileFormatError(
            f"{path}: has properties {found}_0.. and no comment '{_MARK}' that says what they are: "
            "another program has left it out, and its splats would not be what they were"
        )


def _parsed(path: Path, said: str, rest: int) -> SceneBasis:
    """What a comment says; ``rest`` properties angular_0.. tell how many coefficients there are."""
    found: dict[str, str] = {}
    for part in said.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None or match[1] in found:
            raise _meaningless(path, said)
        found[match[1]] = match[2]
    activation, angular = found.get("activation", "clamp"), found.get("angular", "sh")
    orders = [found.get(f"{name} order", "0") for name in ("shape", "color")]
    if angular not in ANGULAR_BASES:
        raise FileFormatError(
            f"{path}: its {ANGULAR_BASES.kind} is {angular!r}, wanted {ANGULAR_BASES.wanted}"
        )
    known = activation in get_args(Activation)
    if not known or any(order not in map(str, range(HIGHEST + 1)) for order in orders):
        raise _meaningless(path, said)
    linear = 0 if angular == "sh" else 1 + rest // 3
    if linear:
        try:
            angular_basis(angular, linear)
        except InputError as error:
            raise FileFormatError(f"{path}: its properties angular_0..: {error}") from error
    how, light = cast(Activation, activation), found.get("environment", "0")
    if light != "0" and not (_LOBES.fullmatch(light) and int(light) <= MOST_LOBES):
        raise _meaningless(path, said)
    return SceneBasis(int(orders[0]), int(orders[1]), how, angular, linear, int(light))


def _meaningless(path: Path, said: str) -> FileFormatError:
    return FileFormatError(
        f"{path}: its comment '{_MARK} {said[:_SHOWN]}' has no meaning; the file is damaged, or of "
        "a newer version"
    )
