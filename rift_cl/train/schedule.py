"""Adam's learning rates from step to step of a fit, and when its cooldown begins."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.train.settings import TrainSettings

# Learning rates at the very end of the cooldown, as a fraction of those at its beginning.
_LAST_SHARE = 0.05


@dataclass(frozen=True)
class Schedule:
    """Learning rates of a run.

    Args:
        settings: of the run.
        extent: size of the scene, in its units.
    """

    settings: TrainSettings
    extent: float

    @property
    def cooldown(self) -> int:
        """The step with which the cooldown begins."""
        return round(self.settings.steps * (1 - self.settings.cooldown))

    def learning_rates(self, step: int) -> dict[str, float]:
        """Adam's learning rates at a step, by group; of positions in units of the scene."""
        rates, settings = self.settings.learning_rates, self.settings
        way = min(step / max(self.cooldown, 1), 1.0)
        falling, fade = rates.means_last**way, 1.0
        if step >= self.cooldown:
            into = (step - self.cooldown) / max(settings.steps - self.cooldown, 1)
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
