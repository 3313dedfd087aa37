"""Slices, volumes and sinograms with their coordinates, as xarray keeps them.

    from rift_cl.interop.xarray import from_xarray, to_xarray

    labelled = to_xarray(volume, grid, unit="mm")      # dims z, y, x
    labelled.sel(z=1.5, method="nearest")
    values, grid = from_xarray(labelled)

Slices have the dimensions y, x, volumes z, y, x. Sinograms have theta (radians), then row where
there are several, then detector, both in the unit of length from where the axis is seen. What
coordinates do not tell, as the distances of a source, is in the attributes, so that either kind is
written and read by xarray's own formats. A coordinate of one sample has the attributes "spacing"
and "spacing_units"; of more samples their places tell, whatever is done to them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import NAMED_AXES, as_host_array, as_real_array
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.geometry import Cone, Fan, Grid, Parallel
from rift_cl.geometry.length_units import length_unit
from rift_cl.geometry.numbers import one_number
from rift_cl.interop.optional_package import optional_package

__all__ = ["from_xarray", "to_xarray"]

Floats = NDArray[np.float32]
Labelled = Grid | Parallel | Fan | Cone
_KIND, _STEP, _STEP_UNIT = "scan", "spacing", "spacing_units"
# Units of angles in radians, by the names that CF, UDUNITS and pint have for them; spaces as "_".
_ANGLES = {
    **dict.fromkeys(("", "1", "rad", "rads", "radian", "radians"), 1.0),
    **dict.fromkeys(("mrad", "milliradian", "milliradians"), 1e-3),
    **dict.fromkeys(
        (
            *("deg", "degs", "degree", "degrees", "°", "arcdeg", "arc_degree", "arc_degrees"),
            *("angle_degree", "angle_degrees", "angular_degree", "angular_degrees"),
            *("degree_angle", "degrees_angle"),
        ),
        np.pi / 180,
    ),
}
# By how much of a step coordinates may stray from even spacing.
_EVEN = 1e-3


def to_xarray(values: ArrayLike, of: Labelled, *, unit: str = "", name: str | None = None) -> Any:
    """Label an image, a volume or a sinogram.

    Args:
        values: (ny, nx) or (nz, ny, nx) on a grid; (views, bins) or (views, rows, bins) of a scan.
        of: what the values stand on.
        unit: of its lengths, such as "mm"; empty where it is not known.
        name: of the array; "attenuation" on a grid and "line_integral" of a scan if not given.

    Returns:
        An ``xarray.DataArray`` of float32.

    Raises:
        ShapeError: the values do not fit.
        DTypeError: they are not real numbers, or ``of`` is no grid and no scan with angles.
        InputError: xarray is not installed.
    """
    xarray = optional_package("xarray", what="to_xarray")
    if not isinstance(of, Labelled):
        raise DTypeError(
            f"of is a {type(of).__name__}, wanted a Grid, or a Parallel, Fan or Cone scan"
        )
    array = as_real_array(values, name="values")
    coordinates, attributes = _grid_labels(of) if isinstance(of, Grid) else _scan_labels(of, array)
    shape = tuple(len(places) for places, _ in coordinates.values())
    array = as_host_array(array, shape, name="values", wants=repr(type(of).__name__))
    on_grid = isinstance(of, Grid)
    value_unit = (f"1/{unit}" if unit else "") if on_grid else "1"
    return xarray.DataArray(
        array,
        dims=list(coordinates),
        coords={
            axis: (axis, places, about | (_in_unit(unit, about) if axis != "theta" else {}))
            for axis, (places, about) in coordinates.items()
        },
        attrs={**attributes, **({"units": value_unit} if value_unit else {})},
        name=name or ("attenuation" if on_grid else "line_integral"),
    )


def from_xarray(array: Any) -> tuple[Floats, Labelled]:
    """Read what is labelled as ``to_xarray`` labels it, whoever did.

    Args:
        array: a ``DataArray`` with the dimensions y, x or z, y, x, or with theta and detector and
            perhaps row, in any order. Coordinates are evenly spaced, all lengths in one unit, those
            of theta in radians or, as their attribute "units" says, in degrees or milliradians.
            Those that fall are turned round. A scan is parallel unless the attribute "scan" is
            "Fan" or "Cone" and the distances are there, in the unit of the coordinates. A
            coordinate with one sample has the attribute "spacing", in the unit of its attribute
            "spacing_units" or else of the coordinate: one that is left of several has it not.

    Returns:
        The values, float32 in the order of dimensions named here, and the grid or scan.

    Raises:
        DTypeError: it is no ``DataArray`` of real numbers.
        ShapeError: it has other dimensions.
        InputError: a coordinate is missing or uneven, or a distance is, or the spacing of one
            sample; or the coordinates are in several units of length, or theta in no unit of angle.
    """
    if not all(hasattr(array, name) for name in ("dims", "coords", "attrs", "transpose")):
        raise DTypeError(f"array is a {type(array).__name__}, wanted an xarray.DataArray")
    names, scan = set(map(str, array.dims)), "theta" in array.dims
    wanted = NAMED_AXES[scan]
    order = [axis for axis in wanted if axis in names]
    if len(order) != len(names) or not {*wanted} - {wanted[1 if scan else 0]} <= names:
        raise ShapeError(
            f"array has the dimensions {', '.join(map(str, array.dims))}; wanted y, x or z, y, x, "
            "or theta, detector or theta, row, detector: rename them with .rename()"
        )
    array = array.transpose(*order)
    for axis in order:
        if axis != "theta":
            # Whoever has no coordinates of rows has their numbers.
            places = _places(array, axis) if axis != "row" or axis in array.coords else None
            if places is not None and places[0] > places[-1]:
                array = array.isel({axis: slice(None, None, -1)})
    values = as_host_array(array.values, array.shape, name="array", wants="a copy")
    return values, (_scan(array) if scan else _grid(array, order))


def _grid_labels(grid: Grid) -> tuple[dict[str, Any], dict[str, Any]]:
    axes = "zyx"[-len(grid.shape) :]
    labels = {
        axis: _label(grid.coordinates(number), grid.spacing[number])
        for number, axis in enumerate(axes)
    }
    return labels, {}


def _scan_labels(
    scan: Parallel | Fan | Cone, values: NDArray[Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    labels: dict[str, Any] = {"theta": (scan.angles, {"units": "rad"})}
    if isinstance(scan, Cone):
        (high, wide), (row, column) = scan.pitch, scan.center
        labels["row"] = _label((np.arange(scan.rows) - row) * high, high)
        if np.any(scan.heights):
            raise InputError("a cone with heights has no one place of each row: label its views")
    else:
        wide, column = scan.pitch, scan.center
        if values.ndim == 3:
            labels["row"] = (np.arange(values.shape[1], dtype=np.float64), {})
    labels["detector"] = _label((np.arange(scan.bins) - column) * wide, wide)
    kind = "Parallel" if isinstance(scan, Parallel) else type(scan).__name__
    attributes: dict[str, Any] = {_KIND: kind}
    if not isinstance(scan, Parallel):
        attributes |= {n: getattr(scan, n) for n in ("source_to_axis", "source_to_detector")}
        attributes["curved"] = int(scan.curved)
    return labels, attributes


def _label(places: NDArray[Any], step: float) -> tuple[NDArray[Any], dict[str, Any]]:
    """The places of samples and, where these do not tell their spacing, an attribute that does."""
    return places, {_STEP: step} if len(places) == 1 else {}


def _in_unit(unit: str, about: dict[str, Any]) -> dict[str, str]:
    """The attributes that name the unit of a coordinate, and of what its attributes hold."""
    names = ("units", _STEP_UNIT) if _STEP in about else ("units",)
    return dict.fromkeys(names, unit) if unit else {}


def _grid(array: Any, order: list[str]) -> Grid:
    _check_one_unit(array, order)
    steps = [_step(array, axis) for axis in order]
    middles = [(places[0] + places[-1]) / 2 for places in (_places(array, a) for a in order)]
    return Grid(array.shape, steps, middles)


def _scan(array: Any) -> Parallel | Fan | Cone:
    theta = _places(array, "theta") * _angle_unit(array)
    pitch, bins = _step(array, "detector"), array.sizes["detector"]
    center = -_places(array, "detector")[0] / pitch
    kind = array.attrs.get(_KIND, "Parallel")
    if kind == "Parallel":
        return Parallel(theta, bins, pitch, center)
    if kind not in ("Fan", "Cone"):
        raise InputError(f"the attribute scan is {kind!r}, wanted Parallel, Fan or Cone")
    near, far = (_distance(array, name) for name in ("source_to_axis", "source_to_detector"))
    curved = bool(array.attrs.get("curved", 0))
    if kind == "Fan":
        return Fan(theta, bins, pitch, near, far, center, curved)
    if "row" not in array.dims:
        raise ShapeError("the attribute scan is Cone, and the array has no dimension row")
    _check_one_unit(array, ["row", "detector"])
    high = _step(array, "row")
    middle = (-_places(array, "row")[0] / high, center)
    return Cone(theta, array.sizes["row"], bins, (high, pitch), near, far, middle, None, curved)


def _unit(array: Any, axis: str) -> str:
    """The unit that a coordinate says it is in; empty where it says none."""
    return str(array.coords[axis].attrs.get("units") or "").strip()


def _angle_unit(array: Any) -> float:
    """The unit of theta in radians."""
    unit = _unit(array, "theta")
    found = _ANGLES.get("_".join(unit.lower().split()))
    if found is None:
        raise InputError(
            f"the coordinate theta is in {unit!r}, wanted radians, milliradians or degrees: "
            "convert it with .assign_coords(), and name the unit in its attribute units"
        )
    return found


def _check_one_unit(array: Any, axes: list[str]) -> None:
    """Make sure that coordinates which name a unit of length name the same, in whatever words.

    Raises:
        InputError: they do not.
    """
    units = {axis: unit for axis in axes if (unit := _unit(array, axis))}
    if len({length_unit(unit) or unit for unit in units.values()}) > 1:
        named = ", ".join(f"{axis} in {unit}" for axis, unit in units.items())
        raise InputError(
            f"the coordinates are in several units, {named}: convert them to one with "
            ".assign_coords()"
        )


def _distance(array: Any, name: str) -> float:
    if name not in array.attrs:
        raise InputError(f"the array has no attribute {name}, which a {array.attrs[_KIND]} needs")
    return one_number(array.attrs[name])


def _places(array: Any, axis: str) -> NDArray[np.float64]:
    if axis not in array.coords:
        raise InputError(f"the array has no coordinate {axis}: give it with .assign_coords()")
    places = as_real_array(array.coords[axis].values, name=axis).astype(np.float64)
    if not places.size or not np.isfinite(places).all():
        raise InputError(f"the coordinate {axis} is empty or not finite")
    return places


def _step(array: Any, axis: str) -> float:
    """The spacing of a coordinate that rises evenly."""
    places = _places(array, axis)
    if len(places) == 1:
        return _noted_step(array, axis)
    step = float((places[-1] - places[0]) / (len(places) - 1))
    if not (step > 0 and np.abs(np.diff(places) - step).max() <= _EVEN * step):
        raise InputError(f"the coordinate {axis} is not evenly spaced: resample it with .interp()")
    return step


def _noted_step(array: Any, axis: str) -> float:
    """The spacing of a coordinate of one sample, as its attribute says it, in its own unit.

    Raises:
        InputError: it says none, or in a unit that is not that of the coordinate.
    """
    about, unit = array.coords[axis].attrs, _unit(array, axis)
    if _STEP not in about:
        raise InputError(
            f"the coordinate {axis} has one sample, which does not tell its spacing: set "
            f"array.{axis}.attrs[{_STEP!r}]"
        )
    step, own = one_number(about[_STEP]), str(about.get(_STEP_UNIT) or unit).strip()
    here, there = length_unit(unit), length_unit(own)
    if here is not None and there is not None:
        return step if here == there else step * there.metres / here.metres
    if own != unit:
        raise InputError(
            f"the coordinate {axis} is in {unit or 'no unit'} and its attribute {_STEP} in {own}: "
            f"convert it, and name its unit in the attribute {_STEP_UNIT}"
        )
    return step
