"""RTK, the peer for cones, on the rays and voxels of ours; ``pip install itk-rtk``.

Its axis of rotation is y, its gantry angle ours in degrees, and it consumes what it is given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift

Floats = NDArray[np.float32]


class Rtk:
    """RTK's filters on a cone and a volume of samples of size 1 about the axis.

    Raises:
        ImportError: RTK is not installed.
    """

    def __init__(self, grid: rift.Grid, scan: rift.Cone) -> None:
        import itk
        from itk import RTK

        self._itk, self._rtk, self._type = itk, RTK, itk.Image[itk.F, 3]
        self._geometry = RTK.ThreeDCircularProjectionGeometry.New()
        for degrees in np.rad2deg(scan.angles):
            lengths = scan.source_to_axis, scan.source_to_detector
            self._geometry.AddProjection(*lengths, float(degrees), 0, 0)
        self._grid, self._scan = grid, scan

    def filtered(self, projections: Floats) -> Floats:
        """Filtered backprojection, its ramp as it is."""
        ours = self._rtk.FDKConeBeamReconstructionFilter[self._type].New()
        ours.GetRampFilter().SetTruncationCorrection(0.0)
        ours.GetRampFilter().SetHannCutFrequency(0.0)
        empty = np.zeros(self._grid.shape, np.float32)
        found = self._run(ours, self._volume(empty), self._projections(projections))
        return found[::-1].transpose(1, 0, 2)

    def backprojected(self, projections: Floats) -> Floats:
        """Its backprojection alone."""
        ours = self._rtk.FDKBackProjectionImageFilter[self._type, self._type].New()
        empty = np.zeros(self._grid.shape, np.float32)
        return self._run(ours, self._volume(empty), self._projections(projections))

    def projected(self, volume: Floats) -> Floats:
        """Line integrals by Joseph's method."""
        scan = self._scan
        ours = self._rtk.JosephForwardProjectionImageFilter[self._type, self._type].New()
        empty = np.zeros((scan.views, scan.rows, scan.bins), np.float32)
        turned = np.ascontiguousarray(volume.transpose(1, 0, 2)[::-1])
        return self._run(ours, self._projections(empty), self._volume(turned))

    def _run(self, ours: Any, *inputs: Any) -> Floats:
        for k, image in enumerate(inputs):
            ours.SetInput(k, image)
        ours.SetGeometry(self._geometry)
        ours.Update()
        return np.asarray(self._itk.array_from_image(ours.GetOutput()))

    def _volume(self, volume: Floats) -> Any:
        return self._image(volume, [-(n - 1) / 2 for n in volume.shape[::-1]], [1.0, 1.0, 1.0])

    def _projections(self, views: Floats) -> Any:
        row, column = self._scan.pitch
        across, down = -self._scan.center[1] * column, -self._scan.center[0] * row
        return self._image(views, [across, down, 0.0], [column, row, 1.0])

    def _image(self, values: Floats, origin: list[float], spacing: list[float]) -> Any:
        image = self._itk.image_from_array(np.array(values, np.float32))
        image.SetOrigin(origin)
        image.SetSpacing(spacing)
        return image
