"""Screen-space gradients of each splat, gathered over frames: what densification goes by.

``kernels/train/splat_statistics.cl`` says what is computed; ``rift_cl.reference.training`` has its
twin.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, InputError
from rift_cl.train.strategy.protocol import Strategy, TrainingRun, check_names

if TYPE_CHECKING:
    from rift_cl.cl.device import Device
    from rift_cl.splat.renderer import Frame, FrameGradients

_COLUMNS = 3


class ScreenStatistics:
    """Statistics of N splats since they were last cleared, on the device.

    Args:
        device: where the splats are.
        count: N.
        absgrad: gather the sum over pixels of the gradient's magnitudes in place of the gradient
            itself, in which pixels that pull in opposite ways cancel (AbsGS, Ye et al. 2024).
    """

    def __init__(self, device: Device, count: int, *, absgrad: bool = False) -> None:
        self.device = device
        self.absgrad = absgrad
        self._table: Any = device.zeros((count, _COLUMNS))

    def __len__(self) -> int:
        """Number of splats."""
        return int(self._table.shape[0])

    def clear(self, count: int) -> None:
        """Begin again with ``count`` splats and no frames."""
        self._table = self.device.zeros((count, _COLUMNS))

    def add(self, frame: Frame, gradients: FrameGradients) -> None:
        """Add what one frame says; nothing waits for the device.

        Args:
            frame: what was drawn, of these splats in this order.
            gradients: of the loss, a mean over the frame's pixels; with several frames to a loss,
                times their number.

        Raises:
            InputError: the frame has other splats, or the magnitudes that are asked for were not
                computed.
        """
        found = gradients.splats
        by = found.means2d_abs if self.absgrad else found.means2d
        if by is None:
            raise InputError(
                "absgrad wants the magnitudes of screen gradients: draw with "
                "SplatSettings(absgrad=True)"
            )
        if by.shape[0] != len(self):
            raise InputError(f"the frame has {by.shape[0]} splats, statistics are of {len(self)}")
        height, width = frame.camera.size
        self.device.launch(
            "splat_statistics",
            (len(self),),
            grad_means2d=by,
            screen=frame.projection.screen,
            culled=frame.projection.culled,
            statistics=self._table,
            half_width=width / 2,
            half_height=height / 2,
            radius_share=1 / max(width, height),
            count=len(self),
        )

    def host(self) -> NDArray[np.float32]:
        """(N, 3): sum of gradients' magnitudes, frames, largest radius; see the kernel."""
        return self.device.get(self._table)

    def restore(self, table: NDArray[np.float32]) -> None:
        """Go on from what ``host`` returned, of as many splats as it was.

        Raises:
            CheckpointError: it is no table of statistics.
        """
        if table.ndim != 2 or table.shape[1] != _COLUMNS:
            raise CheckpointError(f"statistics have shape {table.shape}, wanted (N, {_COLUMNS})")
        if not (np.isfinite(table).all() and (table >= 0).all()):
            raise CheckpointError("statistics hold numbers that are not finite or below zero")
        self._table = self.device.array(table)


class StatisticsStrategy(Strategy):
    """What strategies have in common that go by the statistics of splats on the screen.

    Args:
        run: the run that it serves.
        statistics: of the splats that it begins with.
    """

    def __init__(self, run: TrainingRun, statistics: ScreenStatistics) -> None:
        super().__init__(run)
        self.statistics = statistics

    def state(self) -> dict[str, NDArray[Any]]:
        """The statistics since they were last cleared."""
        return {"statistics": self.statistics.host()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from them; see ``Strategy``."""
        check_names(state, ("statistics",))
        self.statistics.restore(np.asarray(state["statistics"]))
