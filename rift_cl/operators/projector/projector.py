"""The one public name of a matched projector, whose class is chosen by the scan.

Users write ``rift.Projector(grid, scan)`` whatever the scan, and get one of its subclasses, as they
get a path of their own system from ``pathlib.Path``. ``isinstance(A, Projector)`` holds for all.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, overload

from numpy.typing import DTypeLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import check_host
from rift_cl.cl.device import Device
from rift_cl.geometry import Cone, Fan, Grid, Parallel, Vectors
from rift_cl.operators.linear import LinearOperator

if TYPE_CHECKING:
    from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector

# What the rays from a point take on the host for each bin of a view, at least.
_HOST_BYTES = 64


class Projector(LinearOperator):
    """Line integrals of an image or a volume, and their exact adjoint.

    Of a ``Parallel`` scan this is a ``PhaseProjector``, of a ``Fan`` and one slice a
    ``FanProjector``, of a ``Cone`` a ``SlabProjector``, of ``Vectors`` a ``VectorProjector``;
    their documentation says more of footprints and types.

    Args:
        grid: the grid of the image, (ny, nx), or of the volume, (nz, ny, nx).
        scan: angles and detector.
        footprint: the projection of a sample onto the detector: ``strip`` (the default) or
            ``linear``; parallel beams and fans of one slice take ``joseph`` as well, cones
            ``point``.
        device: the device to use; the default device if not given.
        dtype: ``float32`` (the default), or ``float64`` where the device has it.

    The domain is ``grid.shape``; the range is (angles, bins), or (angles, nz, bins) for a volume,
    or (views, rows, bins) of a cone or of vectors. Values of the range are in the image's unit
    times the grid's unit of length.

    Raises:
        InputError: ``grid`` is no ``Grid``, ``scan`` no scan, or the footprint or the type unknown.
        DeviceError: the device has no float64.
    """

    grid: Grid
    footprint: str
    # What else a projector of this kind is made from, by name.
    _settled: tuple[str, ...] = ()

    @overload
    def __new__(
        cls,
        grid: Grid,
        scan: Parallel,
        footprint: str = ...,
        device: Device | None = ...,
        dtype: DTypeLike = ...,
    ) -> PhaseProjector: ...
    @overload
    def __new__(cls, grid: Grid, scan: Any, *given: Any, **named: Any) -> Projector: ...
    def __new__(cls, grid: Grid, scan: Any, *given: Any, **named: Any) -> Projector:
        """Make the subclass that the scan asks for, whose ``__init__`` reads the arguments."""
        return object.__new__(_kind(grid, scan) if cls is Projector else cls)

    def __reduce__(self) -> tuple[Any, ...]:
        settled = {name: getattr(self, name) for name in self._settled}
        given = self.grid, self.scan, self.footprint, self.device, self.dtype
        return partial(type(self), **settled), given

    # Not abstract, since for a type checker a call of Projector may make one of these.
    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        raise NotImplementedError

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        raise NotImplementedError


def _kind(grid: Grid, scan: Any) -> type[Projector]:
    if isinstance(scan, Fan | Cone | Vectors):
        check_host(_HOST_BYTES * scan.bins, what=f"a detector of {scan.bins} bins")
    if isinstance(scan, Fan) and isinstance(grid, Grid) and len(grid.shape) == 2:
        from rift_cl.operators.projector.fan.fan_projector import FanProjector

        return FanProjector
    if isinstance(scan, Fan):
        from rift_cl.operators.projector.fan.fan_slices_projector import FanSlicesProjector

        return FanSlicesProjector
    if isinstance(scan, Cone):
        from rift_cl.operators.projector.cone.slab_projector import SlabProjector

        return SlabProjector
    if isinstance(scan, Vectors):
        from rift_cl.operators.projector.cone.vector_projector import VectorProjector

        return VectorProjector
    from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector

    return PhaseProjector
