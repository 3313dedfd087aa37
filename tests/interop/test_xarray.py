"""Arrays with coordinates: what is labelled and read again is the same grid or scan."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ShapeError
from rift_cl.interop.xarray import from_xarray, to_xarray
from rift_cl.reconstruct import widened

xarray = pytest.importorskip("xarray", reason="xarray is not installed")

ANGLES = np.linspace(0.1, 3, 5)
THINGS = {
    "slice": (rift.Grid((4, 6), 0.3, (1, -2)), (4, 6), ("y", "x")),
    "volume": (rift.Grid((3, 4, 6), (0.5, 0.3, 0.2), (1, 2, 3)), (3, 4, 6), ("z", "y", "x")),
    "one slice": (rift.Grid((1, 4, 6), (0.5, 0.3, 0.2)), (1, 4, 6), ("z", "y", "x")),
    "sinogram": (rift.Parallel(ANGLES, 7, 0.25, 2.5), (5, 7), ("theta", "detector")),
    "sinograms": (rift.Parallel(ANGLES, 7, 0.25), (5, 3, 7), ("theta", "row", "detector")),
    "fan": (rift.Fan(ANGLES, 7, 0.25, 20, 30, 2.5, True), (5, 7), ("theta", "detector")),
    "cone": (
        rift.Cone(ANGLES, 3, 7, (0.5, 0.25), 20, 30, (1.5, 3)),
        (5, 3, 7),
        ("theta", "row", "detector"),
    ),
}


def values_of(shape):
    return np.random.default_rng(0).standard_normal(shape).astype(np.float32)


def fields(thing):
    return {name: np.asarray(value) for name, value in vars(thing).items() if name != "heights"}


@pytest.mark.each
@pytest.mark.parametrize("name", THINGS)
def test_what_is_labelled_is_read_again(name):
    thing, shape, dims = THINGS[name]
    values = values_of(shape)
    labelled = to_xarray(values, thing, unit="mm")
    assert labelled.dims == dims
    assert all(
        labelled[axis].attrs["units"] == ("rad" if axis == "theta" else "mm") for axis in dims
    )
    for order in (dims, dims[::-1]):
        again, found = from_xarray(labelled.transpose(*order))
        assert np.array_equal(again, values)
        assert type(found) is type(thing)
        for field, value in fields(thing).items():
            assert np.allclose(fields(found)[field], value, atol=1e-12), field


def test_views_of_an_axis_off_the_middle_are_labelled_as_parallel():
    turn = rift.Parallel(np.arange(40) * np.pi / 20, 6, center=1.2)
    joined, wide = widened(values_of((40, 6)), turn)
    values, found = from_xarray(to_xarray(joined, wide))
    assert isinstance(found, rift.Parallel) and found.center == pytest.approx(wide.center)
    assert np.array_equal(values, joined)


def test_coordinates_are_those_of_the_grid_and_the_scan():
    grid, scan = THINGS["slice"][0], THINGS["sinogram"][0]
    labelled = to_xarray(values_of((4, 6)), grid, unit="mm")
    assert np.array_equal(labelled.y, grid.coordinates(0))
    assert labelled.attrs["units"] == "1/mm"
    assert np.array_equal(to_xarray(values_of((5, 7)), scan).detector, scan.coordinates())


def test_an_operator_takes_what_is_labelled(device):
    grid, scan = rift.Grid((4, 6)), rift.Parallel(ANGLES, 7)
    A, x = rift.Projector(grid, scan, device=device), values_of((4, 6))
    assert np.array_equal(A(to_xarray(x, grid)), A(x))


def test_a_file_keeps_it_all(tmp_path):
    cone, shape, _ = THINGS["cone"]
    labelled = to_xarray(values_of(shape), cone, unit="mm")
    pytest.importorskip("scipy.io", reason="netCDF is written by SciPy here")
    labelled.to_netcdf(tmp_path / "scan.nc", engine="scipy")
    with xarray.open_dataarray(tmp_path / "scan.nc", engine="scipy") as read:
        values, found = from_xarray(read)
    assert np.array_equal(values, labelled.values)
    assert np.allclose(found.center, cone.center)
    assert found.source_to_axis == 20


def test_a_coordinate_that_falls_is_turned_round():
    grid = THINGS["slice"][0]
    values = values_of((4, 6))
    again, found = from_xarray(to_xarray(values, grid)[::-1])
    assert np.array_equal(again, values)
    assert np.allclose(found.center, grid.center)


def in_unit(unit, factor):
    """A sinogram whose angles are in a unit that so many make a radian of."""
    labelled = to_xarray(values_of((5, 7)), THINGS["sinogram"][0])
    attributes = {} if unit is None else {"units": unit}
    return labelled.assign_coords(theta=("theta", factor * ANGLES, attributes))


def test_angles_are_read_in_the_unit_that_they_are_marked_with():
    degrees = ("degrees", "deg", "Degree", "°", "arc_degree", "angle_degree", "degree_angle")
    units = dict.fromkeys(degrees, 180 / np.pi) | dict.fromkeys((None, "", "rad", "radians"), 1)
    for unit, factor in (units | {"mrad": 1000}).items():
        assert np.allclose(from_xarray(in_unit(unit, factor))[1].angles, ANGLES), unit
    with pytest.raises(InputError, match=r"theta is in 'turns'.*degrees"):
        from_xarray(in_unit("turns", 1))


def test_lengths_are_in_one_unit_by_whatever_name():
    grid, cone = THINGS["slice"][0], THINGS["cone"][0]
    slices, views = to_xarray(values_of((4, 6)), grid), to_xarray(values_of((5, 3, 7)), cone)
    for axis, (one, other), array in (("x", "yx", slices), ("row", ("row", "detector"), views)):
        mixed = array.copy()
        mixed[one].attrs["units"], mixed[other].attrs["units"] = "mm", "millimeter"
        again = from_xarray(mixed)[1]
        assert np.shape(again.center) == (2,)
        mixed[axis].attrs["units"] = "um"
        with pytest.raises(InputError, match=r"several units.*um"):
            from_xarray(mixed)
    # Rows of parallel rays are numbers, whatever they are said to be in.
    rows = to_xarray(values_of((5, 3, 7)), THINGS["sinograms"][0], unit="mm")
    rows["row"].attrs["units"] = "pixel"
    assert from_xarray(rows)[1].pitch == 0.25


def volume_of_eight():
    return to_xarray(values_of((8, 4, 6)), rift.Grid((8, 4, 6), 0.5, (1, 2, 3)), unit="mm")


def in_micrometres(labelled):
    """The same, its coordinates converted as people do: their attributes go along."""
    return labelled.assign_coords(
        {
            axis: (axis, 1000 * labelled[axis].values, {**labelled[axis].attrs, "units": "um"})
            for axis in labelled.dims
        }
    )


def test_one_sample_that_is_left_of_several_does_not_tell_its_spacing():
    whole = volume_of_eight()
    assert from_xarray(whole.coarsen(z=4).mean())[1].spacing == (2.0, 0.5, 0.5)
    for left in (
        whole.coarsen(z=8).mean(),
        whole.isel(z=slice(0, 7)).coarsen(z=7).mean(),
        whole.isel(z=slice(0, None, 8)),
        whole.isel(z=[3]),
    ):
        with pytest.raises(InputError, match=r"coordinate z has one sample.*array\.z\.attrs"):
            from_xarray(left)
        left.z.attrs["spacing"] = 4
        assert from_xarray(left)[1].spacing == (4.0, 0.5, 0.5)


def test_the_spacing_of_one_sample_has_a_unit_that_is_heeded():
    one = to_xarray(values_of((1, 4, 6)), THINGS["one slice"][0], unit="mm")
    assert one.z.attrs["spacing_units"] == "mm"
    found = from_xarray(in_micrometres(one))[1]
    assert np.allclose(found.spacing, (500, 300, 200))
    # What nobody can convert is not guessed.
    odd = one.assign_coords({axis: one[axis].assign_attrs(units="furlong") for axis in one.dims})
    with pytest.raises(InputError, match=r"coordinate z is in furlong and its .* spacing in mm"):
        from_xarray(odd)
    bare = to_xarray(values_of((1, 4, 6)), THINGS["one slice"][0])
    assert from_xarray(bare)[1].spacing == (0.5, pytest.approx(0.3), pytest.approx(0.2))


def uneven(labelled):
    return labelled.assign_coords(x=np.arange(6.0) ** 2)


BAD = {
    "array": (lambda a: a.values, DTypeError, "ndarray, wanted an xarray.DataArray"),
    "names": (lambda a: a.rename(x="u"), ShapeError, r"dimensions y, u.*rename"),
    "no coordinate": (lambda a: a.drop_vars("x"), InputError, "no coordinate x.*assign_coords"),
    "uneven": (uneven, InputError, "coordinate x is not evenly spaced"),
    "NaN": (lambda a: a * np.nan, InputError, "array holds NaN"),
    "scan": (
        lambda a: to_xarray(values_of((5, 7)), THINGS["fan"][0]).assign_attrs(scan="spiral"),
        InputError,
        "'spiral'",
    ),
    "distance": (
        lambda a: to_xarray(values_of((5, 7)), THINGS["sinogram"][0]).assign_attrs(scan="Fan"),
        InputError,
        "no attribute source_to_axis, which a Fan needs",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_read_is_named(case):
    change, error, words = BAD[case]
    with pytest.raises(error, match=words):
        from_xarray(change(to_xarray(values_of((4, 6)), THINGS["slice"][0])))


def test_what_cannot_be_labelled_is_named():
    with pytest.raises(ShapeError, match=r"values has shape \(3, 6\).*\(4, 6\)"):
        to_xarray(values_of((3, 6)), THINGS["slice"][0])
    with pytest.raises(DTypeError, match="of is a int, wanted a Grid"):
        to_xarray(values_of((3, 6)), 3)


def test_an_operator_takes_named_axes_in_its_own_order_alone(device):
    grid, scan = rift.Grid((6, 6)), rift.Parallel(ANGLES, 5)
    A, image, sinogram = (
        rift.Projector(grid, scan, device=device),
        values_of((6, 6)),
        values_of((5, 5)),
    )
    labelled, views = to_xarray(image, grid), to_xarray(sinogram, scan)
    assert np.array_equal(A(labelled), A(image))
    with pytest.raises(ShapeError, match=r"dimensions x, y, .*\.transpose\('y', 'x'\)"):
        A(labelled.transpose("x", "y"))
    for solve in (rift.fbp, rift.cgls):
        with pytest.raises(ShapeError, match=r"\.transpose\('theta', 'detector'\)"):
            solve(A, views.transpose("detector", "theta"))
    turned = labelled.transpose("x", "y").rename(x="u", y="v")
    assert np.array_equal(A(turned), A(image.T))
