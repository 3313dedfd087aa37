"""What changes from step to step of a fit: Adam's rates, and when the finish begins."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.train.settings import TrainSettings

# Rates at the very end of the finish, as a share of those at its beginning.
_LAST_SHARE = 0.05


@dataclass(frozen=True)
class Schedule:
    """What changes from step to step.

    Args:
        settings: of the run.
        extent: of the scene.
    """

    settings: TrainSettings
    extent: float

    @property
    def finish(self) -> int:
        """The step with which the finish begins."""
        return round(self.settings.steps * (1 - self.settings.finish))

    def rates(self, step: int) -> dict[str, float]:
        """Adam's rates at a step, by group."""
        rates, settings = self.settings.rates, self.settings
        way = min(step / max(self.finish, 1), 1.0)
        falling, fade = rates.means_last**way, 1.0
        if step >= self.finish:
            into = (step - self.finish) / max(settings.steps - self.finish, 1)
            fade = _LAST_SHARE**into
        return {
            "means": fade * self.extent * rates.means * falling,
            "quats": fade * rates.quats,
            "log_scales": fade * rates.log_scales,
            "logits": fade * rates.logits,
            "sh": fade * rates.sh,
            "shape_modes": fade * rates.shape_modes,
            "color_modes": fade * rates.color_modes,
            "lobes": fade * rates.lobes,
            "poses": fade * rates.poses * falling,
            "exposures": fade * rates.exposures * falling,
        }
