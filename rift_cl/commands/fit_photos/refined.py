"""What a fit found of each photograph besides the splats: poses and exposures, told and recorded.

Those of held-out photographs are fitted to the very pictures that are scored, so that it is said,
and scored without them as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.io.captures.capture import View
from rift_cl.train.trainer import Trainer

# Share of what a camera can move by above which the middle one was probably held back.
_STILL_MOVING = 0.7


def pose_record(trainer: Trainer) -> dict[str, Any]:
    """How far the cameras that were trained on have moved, and what all have in common; JSON.

    Turns are in degrees, shifts in the scene's unit.
    """
    poses = trainer.poses
    if poses is None:
        return {}
    turned, moved = poses.moved().T
    reach, common = trainer.schedule.pose_reach, poses.common_motion(trainer.size)
    return {
        "poses": {
            "turned": _spread(np.degrees(turned), np.degrees(reach)),
            "moved": _spread(moved, reach * poses.extent),
            "common": {
                "scale": common.scale,
                "turned": float(np.degrees(Rotation.from_matrix(common.turn).magnitude())),
                "shift": common.shift.tolist(),
            },
        }
    }


def _spread(values: NDArray[np.float64], reach: float) -> dict[str, float]:
    median, largest = float(np.median(values)), float(values.max())
    return {"median": median, "largest": largest, "reach": float(reach)}


def pose_notes(metrics: Mapping[str, Any]) -> list[str]:
    """Sentences about poses that were refined."""
    if "poses" not in metrics:
        return []
    turned, moved = metrics["poses"]["turned"], metrics["poses"]["moved"]
    notes = [
        f"Cameras were turned by {turned['median']:.2g} degrees and moved by "
        f"{moved['median']:.2g} units (medians; {turned['largest']:.2g} and "
        f"{moved['largest']:.2g} at most), of {turned['reach']:.2g} degrees about each axis and "
        f"{moved['reach']:.2g} units along each that a run lets them."
    ]
    held_back = [kind for kind in (turned, moved) if kind["median"] > _STILL_MOVING * kind["reach"]]
    if any(kind["reach"] > 0 for kind in held_back):
        notes.append(
            "Poses were still moving when the run ended: take more --steps, or a larger "
            "--learning-rates.pose-reach where they are as far off as that."
        )
    if metrics["scores"]:
        notes.append(
            "Poses of the photographs that are scored were refined too, each against its own "
            "photograph, with the splats as they are; 'as given' scores the poses that they came "
            "with."
        )
    return notes


def exposure_record(
    trainer: Trainer, views: Sequence[View], groups: Mapping[str, Sequence[ViewScore]]
) -> dict[str, Any]:
    """Gains and offsets by photograph, those that were trained on and those that are scored; JSON.

    Args:
        trainer: of the fit.
        views: that were trained on.
        groups: scores of pictures by the name of their group.
    """
    if trainer.exposures is None:
        return {}
    trained = zip(views, trainer.exposures.values, strict=True)
    found = {"trained": {view.name: _exposure(values) for view, values in trained}}
    for name, scores in groups.items():
        fitted = {s.name: _exposure(s.exposure) for s in scores if s.exposure is not None}
        found[name] = fitted
    return {"exposures": found}


def _exposure(values: NDArray[np.float64]) -> dict[str, list[float]]:
    return {"gain": values[0].tolist(), "offset": values[1].tolist()}


def exposure_notes(metrics: Mapping[str, Any]) -> list[str]:
    """Sentences about exposures that were fitted."""
    if "exposures" not in metrics:
        return []
    gains = np.array([found["gain"] for found in metrics["exposures"]["trained"].values()])
    notes = [
        f"The photographs' gains were found between {gains.min():.2f} and {gains.max():.2f} of "
        "their mean; all gains and offsets are in metrics.json."
    ]
    if metrics["scores"]:
        notes.append(
            "A gain and an offset of each colour were fitted to the photographs that are scored, "
            "too; 'as given' scores the splats without them."
        )
    return notes
