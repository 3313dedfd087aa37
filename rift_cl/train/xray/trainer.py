"""The trainer of X-ray splats: densities alone, and in one slice if the scan has only one.

Line integrals need no colour: it is one, has no rate, and the loss looks at the first channel. A
scan of one detector row says nothing about what is across it. Gradients there are no more than
rounding, which Adam would blow up to whole steps, so that after each step the splats are put back
into their slice; modes of their shapes that vary across it stay at zero.

How far the cameras spread is no measure of the object: a source may be far away, and that of
parallel beams is nowhere. Rates of positions go by the reach of the volume instead.
"""

from __future__ import annotations

import numpy as np

from rift_cl.cl.arithmetic import copy_columns
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import TrainSettings
from rift_cl.train.start.xray import FLAT
from rift_cl.train.trainer import Trainer, TrainingViews
from rift_cl.train.xray.density_solve import solve_densities

# What the rates of positions were found with, in parallel beams over half a turn.
_REACHES = 2.6


def volume_extent(reach: float) -> float:
    """The length that positions' rates are measured in, the same for all geometries.

    Args:
        reach: distance from the rotation axis to the outermost ray.
    """
    return _REACHES * reach


class XrayTrainer(Trainer):
    """A fit of densities in progress.

    Args:
        pictures: projections of one channel, of lengths in detector bins.
        parameters: the splats to begin with, which have densities.
        settings: of the fit.
        rendering: of the rasterizer, in xray mode.
        flat: whether there is but one detector row.
        extent: the length that positions' rates are measured in; see ``volume_extent``.
    """

    solves = True

    def __init__(
        self,
        pictures: TrainingViews,
        parameters: Parameters,
        settings: TrainSettings,
        rendering: SplatSettings,
        *,
        flat: bool,
        extent: float,
    ) -> None:
        super().__init__(pictures, parameters, settings, rendering, flat=flat, extent=extent)
        count = len(parameters)
        self._zero = self.device.zeros((count, 2)) if flat else None
        thin = np.full((count, 1), np.log(FLAT), np.float32)
        self._thin = self.device.array(thin) if flat else None

    def _before_step(self) -> None:
        """Solve where it is due."""
        if self.settings.solve.due(self.parameters.step):
            self._solve()

    def _after_step(self) -> None:
        """Put splats of a single slice back into it, and solve after the last step."""
        if self._zero is not None and self._thin is not None:
            raw = self.parameters.raw
            copy_columns(self.device, self._zero, 0, raw["means"], 2, 1)
            copy_columns(self.device, self._zero, 0, raw["quats"], 1, 2)
            copy_columns(self.device, self._thin, 0, raw["log_scales"], 2, 1)
            self.parameters.activate()
        if self.settings.solve.every and self.parameters.step == self.settings.steps:
            self._solve()

    def _solve(self) -> None:
        """Solve for the densities and shape modes of the splats where they are."""
        settings = self.settings
        solve_densities(
            *(self.parameters, self.renderer, self.pictures, settings.solve), seed=settings.seed
        )
        # What is held follows from the modes, which are others now.
        self.coefficient_schedule.hold(self.parameters)
