"""How good a fit is: scores on pictures it never saw, beside what no fit at all would score.

A dense ring of cameras makes blending of neighbours look good, so that two baselines stand beside
every score: the nearest training picture as it is, and the mean of the two nearest. Nearest is by
angle as seen from where the cameras look; that angle is in the table too. The foreground is what
differs from the background by more than two codes, or what alpha says.
"""

from __future__ import annotations

import functools
import math
import operator
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.fit_photos.error_places import ErrorPlaces, by_distance, by_elevation
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.inputs.scene_bounds import common_up
from rift_cl.commands.pictures.views_table import angles_of
from rift_cl.geometry import Camera
from rift_cl.metrics import psnr, ssim
from rift_cl.splat.renderer import Picture, Renderer
from rift_cl.splat.splats import Splats
from rift_cl.train.per_view.exposures import fitted_exposure
from rift_cl.train.start.points import focus_of

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Masks = tuple[Mask | None, Mask | None]
# A score of a picture (height, width, 3) in display light beside the truth, over the pixels
# (height, width) that count, None for all; None where it has no meaning of a part of a picture.
Score = Callable[[Floats, Floats, Mask | None], float | None]


@dataclass(frozen=True)
class ViewScore:
    """Scores of one picture.

    Args:
        name: of the picture.
        angle: to the nearest training picture, in degrees.
        values: PSNR in dB and SSIM by name, of the whole picture and of its foreground.
        truth: (height, width, 3) what it should be.
        image: (height, width, 3) what was drawn.
        elevation: of the camera above the focus, in degrees; NaN where it is not known.
        distance: to the nearest training camera over that to the focus; NaN where it is not known.
        places: where the picture errs; None of X-rays.
        counted: (height, width) the pixels that count; None for all.
        exposure: (2, 3) gain and offset of each colour that ``image`` was given to fit the truth;
            None where it is as it was drawn.
        trained: whether the splats were trained on this very picture, which so has no angle, no
            distance and no baselines.
        unseen: whether no splat is in sight.
    """

    name: str
    angle: float
    values: dict[str, float]
    truth: Floats
    image: Floats
    elevation: float = math.nan
    distance: float = math.nan
    places: ErrorPlaces | None = None
    counted: Mask | None = None
    exposure: NDArray[np.float64] | None = None
    trained: bool = False
    unseen: bool = False


def score_views(
    renderer: Renderer,
    splats: Splats,
    test: CapturePictures,
    training: CapturePictures | None,
    more: Mapping[str, Score] | None = None,
    *,
    given: Sequence[Camera] | None = None,
    exposed: bool = False,
) -> Iterator[ViewScore]:
    """Render and score every picture of ``test``.

    What a mask leaves nothing of is left out. Where a pose or an exposure is fitted to a picture,
    what is drawn without them is scored as well, and these scores are called "given".

    Args:
        renderer: of the splats.
        splats: what is scored.
        test: the pictures.
        training: those that were trained on; without them there are no angles, no distances and no
            baselines. Pictures of ``test`` that are among them have none either.
        more: scores by name besides PSNR and SSIM.
        given: cameras of ``test`` as they were given, where it has others.
        exposed: whether what is drawn is given the gains and offsets that fit the picture best.
    """
    cameras = (training or test).cameras
    behind, focus, up = test.behind, focus_of(cameras), common_up(cameras)
    trained_on = {view.image.resolve() for view in training.views} if training else set()

    def drawn(camera: Camera) -> Picture:
        return renderer.picture(splats, camera, background=renderer.device.array(behind))

    for number, camera in enumerate(test.cameras):
        counted, foreground = test.counted(number), test.foreground(number)
        if counted is not None and not counted.any():
            warnings.warn(
                f"{test.views[number].name}: its mask is black, so that it is not scored",
                stacklevel=2,
            )
            continue
        # A lens may well leave nothing out.
        masks = None if counted is None or counted.all() else counted, foreground
        photograph, (image, rest), exposure = test.over(number, behind), drawn(camera), None
        truth = test.shown(photograph)
        plain = image if given is None else drawn(given[number]).image
        if exposed:
            exposure = fitted_exposure(image, photograph, masks[0])
            image = (exposure[0] * image + exposure[1]).astype(np.float32)
        image = test.shown(image)
        values, angle, distance = scores_of(image, truth, masks, "fit", more), math.nan, math.nan
        if exposed or given is not None:
            values |= scores_of(test.shown(plain), truth, masks, "given", more)
        trained = test.views[number].image.resolve() in trained_on
        if training is not None and not trained:
            angles = _angles(training.cameras, camera, focus)
            angle, distance = float(angles.min()), _distance(training.cameras, camera, focus)
            for name, blend in _baselines(training, angles, truth.shape, behind).items():
                values |= scores_of(blend, truth, masks, name, more)
        elevation = math.nan if up is None else angles_of(camera, focus, up)[1]
        places = ErrorPlaces.of(image, truth, *masks)
        name = test.views[number].name
        where = (elevation, distance, places, masks[0])
        unseen = bool(rest.min() >= 1)
        yield ViewScore(name, angle, values, truth, image, *where, exposure, trained, unseen)


def scores_of(
    image: Floats,
    truth: Floats,
    masks: Masks,
    name: str,
    more: Mapping[str, Score] | None = None,
) -> dict[str, float]:
    """PSNR and SSIM of all that counts, and PSNR of the foreground, where there is one.

    Nothing that is drawn or photographed at the others changes a score.

    Args:
        image: (height, width, C) what is scored.
        truth: what it should be.
        masks: the pixels that count at all, and the foreground; None where it is all of them, or
            where nobody can tell.
        name: goes before the scores' names.
        more: further scores of all that counts.
    """
    counted, foreground = masks
    channels = range(truth.shape[2])
    values = {
        f"{name}_psnr": psnr(image, truth, mask=_of_samples(counted, truth)),
        f"{name}_ssim": float(
            np.mean([ssim(image[..., c], truth[..., c], mask=counted) for c in channels])
        ),
    }
    if foreground is not None and foreground.any() and not foreground.all():
        values[f"{name}_psnr_foreground"] = psnr(image, truth, mask=_of_samples(foreground, truth))
    for kind, score in (more or {}).items():
        value = score(image, truth, counted)
        if value is not None:
            values[f"{name}_{kind}"] = value
    return values


def _of_samples(mask: Mask | None, truth: Floats) -> Mask | None:
    return None if mask is None else np.repeat(mask[..., None], truth.shape[2], axis=2)


def mean_scores(scores: Sequence[ViewScore]) -> dict[str, float]:
    """The mean of every score over the pictures that have it, and infinite ones where all are."""
    names = dict.fromkeys(name for score in scores for name in score.values)
    return {name: _mean([s.values[name] for s in scores if name in s.values]) for name in names}


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite or values))


class Brightness(NamedTuple):
    """How much brighter pictures are than they were drawn.

    Args:
        spread: standard deviation of the pictures' factors, as a fraction.
        explained: share of the squared error that is gone once each picture has its factor.
    """

    spread: float
    explained: float


def brightness_of(scores: Sequence[ViewScore]) -> Brightness:
    """Factors of pictures by least squares, and what they explain.

    Photographs of one exposure have a spread of a percent or so, and where they have more because a
    fit fails, no factor explains its errors.
    """
    factors, before, after = [], 0.0, 0.0
    for score in scores:
        counts = slice(None) if score.counted is None else score.counted
        image, truth = (a[counts].astype(np.float64) for a in (score.image, score.truth))
        square, product = float((image**2).sum()), float((image * truth).sum())
        if square > 0 and product > 0:
            factors.append(product / square)
            before += float(((image - truth) ** 2).sum())
            after += float((truth**2).sum()) - product**2 / square
    if len(factors) < 2 or before <= 0:
        return Brightness(0.0, 0.0)
    return Brightness(float(np.std(np.log(factors))), 1 - after / before)


def score_record(groups: Mapping[str, Sequence[ViewScore]]) -> dict[str, Any]:
    """The mean scores of each group of pictures, and those of every picture; JSON."""
    return {
        "scores": {name: mean_scores(scores) for name, scores in groups.items()},
        "views": {
            name: [{"name": s.name, "angle": s.angle, **s.values} for s in scores]
            for name, scores in groups.items()
        },
    }


def error_record(groups: Mapping[str, Sequence[ViewScore]]) -> dict[str, Any]:
    """Where the pictures of each group err: by region, band, elevation and distance; JSON."""
    return {"errors": {name: _places_record(scores) for name, scores in groups.items()}}


def _places_record(scores: Sequence[ViewScore]) -> dict[str, Any]:
    total = functools.reduce(operator.add, (s.places for s in scores if s.places is not None))
    return {
        "regions": total.region_record(),
        "bands": total.band_record(),
        "by_elevation": by_elevation((s.elevation, s.values["fit_psnr"]) for s in scores),
        "by_distance": by_distance((s.distance, s.values["fit_psnr"]) for s in scores),
    }


def _angles(cameras: Sequence[Camera], camera: Camera, focus: NDArray[np.float64]) -> Floats:
    """Degrees between a camera and others, measured at their focus."""
    ways = np.array([other.center for other in cameras]) - focus
    way = camera.center - focus
    across = np.linalg.norm(np.cross(ways, way), axis=1)
    return np.asarray(np.degrees(np.arctan2(across, ways @ way)), np.float32)


def _distance(cameras: Sequence[Camera], camera: Camera, focus: NDArray[np.float64]) -> float:
    """From a camera to the nearest of others, over that to their focus."""
    nearest = min(float(np.linalg.norm(other.center - camera.center)) for other in cameras)
    away = float(np.linalg.norm(camera.center - focus))
    return nearest / away if away > 0 else math.nan


def _baselines(
    training: CapturePictures, angles: Floats, shape: tuple[int, ...], behind: Floats
) -> dict[str, Floats]:
    """The nearest training picture, and the mean of the two nearest, where their sizes agree."""
    nearest = np.argsort(angles, kind="stable")[:2].tolist()
    pictures = [training.shown(training.over(number, behind)) for number in nearest]
    if any(picture.shape != shape for picture in pictures):
        return {}
    return {"nearest": pictures[0], "blend": np.mean(pictures, axis=0, dtype=np.float32)}
