"""A fit beside what no fit scores: means over the pictures that all of the compared have.

A training picture of another size is no baseline, and PSNR is infinite where a picture is exact, as
a blank one easily is. Means over different pictures would compare the pictures and not the fit.
Pictures that were trained on have no baselines either: what a fit has of them is no held-out score.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rift_cl.commands.fit_photos.scores import ViewScore, mean_scores

# What a table compares, by the beginning of the scores' names. Where poses or exposures are fitted
# to the pictures that are scored, what is drawn without that is "given".
COMPARED = ("fit", "given", "nearest", "blend")


class ComparedMeans(NamedTuple):
    """Means of one kind of score over the same pictures.

    Args:
        pictures: over how many.
        means: by the name of what is compared; the fit is alone where no picture has a finite score
            of all.
    """

    pictures: int
    means: dict[str, float]


def compared_means(scores: Sequence[ViewScore], kind: str) -> ComparedMeans:
    """The means over the pictures of which all that is compared has a finite score.

    Args:
        scores: of pictures, one of which has this kind at least.
        kind: such as "psnr".
    """
    names = [name for name in COMPARED if any(f"{name}_{kind}" in s.values for s in scores)]
    rows = [[score.values.get(f"{name}_{kind}", math.inf) for name in names] for score in scores]
    common = [row for row in rows if all(map(math.isfinite, row))]
    if not common:
        alone = mean_scores(scores)[f"{COMPARED[0]}_{kind}"]
        return ComparedMeans(len(scores), {COMPARED[0]: alone})
    return ComparedMeans(
        len(common), dict(zip(names, np.mean(common, axis=0).tolist(), strict=True))
    )


def compared_record(groups: Mapping[str, Sequence[ViewScore]]) -> dict[str, Any]:
    """What tables compare, by group of pictures and kind of score; JSON."""
    return {"compared": {name: _compared_kinds(scores) for name, scores in groups.items()}}


def trained_record(groups: Mapping[str, Sequence[ViewScore]]) -> dict[str, Any]:
    """Which pictures of each group were trained on, and mean scores of the others; JSON.

    Empty where there are none in any group.
    """
    mixed = {name: scores for name, scores in groups.items() if any(s.trained for s in scores)}
    record = {
        name: {
            "pictures": [score.name for score in scores if score.trained],
            "others": mean_scores([score for score in scores if not score.trained]),
        }
        for name, scores in mixed.items()
    }
    return {"trained_on": record} if record else {}


def _compared_kinds(scores: Sequence[ViewScore]) -> dict[str, dict[str, float]]:
    mark = f"{COMPARED[0]}_"
    names = dict.fromkeys(name for score in scores for name in score.values)
    kinds = [name.removeprefix(mark) for name in names if name.startswith(mark)]
    found = {kind: compared_means(scores, kind) for kind in kinds}
    return {kind: {"pictures": row.pictures, **row.means} for kind, row in found.items()}


def comparison_notes(groups: Mapping[str, Sequence[ViewScore]]) -> list[str]:
    """Which pictures are in no comparison, and why: a sentence for each group and reason."""
    return [
        note
        for name, scores in groups.items()
        for note in (
            *_trained_notes(name, scores),
            *_size_notes(name, scores),
            *_exact_notes(name, scores),
        )
    ]


def _trained_notes(group: str, scores: Sequence[ViewScore]) -> list[str]:
    trained = [score for score in scores if score.trained]
    if not trained:
        return []
    others = [score for score in scores if not score.trained]
    whole = mean_scores(scores)["fit_psnr"]
    sentence = (
        f"{len(trained)} of the {len(scores)} pictures of {group}, such as {trained[0].name}, were "
        f"trained on, which flatters the {whole:.4g} dB over all of them: "
    )
    if not others:
        return [f"{sentence}none is left that was held out"]
    held_out = mean_scores(others)["fit_psnr"]
    return [f"{sentence}the fit has {held_out:.4g} dB over the {len(others)} others"]


def _size_notes(group: str, scores: Sequence[ViewScore]) -> list[str]:
    # Without training pictures there is no angle to them, and nothing that is compared.
    lacking = [s for s in scores if math.isfinite(s.angle) and "nearest_psnr" not in s.values]
    if not lacking:
        return []
    count = len(scores)
    sentence = (
        f"{len(lacking)} of the {count} pictures of {group}, such as {lacking[0].name}, have no "
        "'nearest' and no 'blend', since one of the two nearest training pictures has another size"
    )
    if len(lacking) == count:
        return [f"{sentence}: there is nothing to compare the fit with"]
    whole = mean_scores(scores)["fit_psnr"]
    return [
        f"{sentence}: means that are compared leave them out; over all {count} the fit has "
        f"{whole:.4g} dB"
    ]


def _exact_notes(group: str, scores: Sequence[ViewScore]) -> list[str]:
    exact = [s for s in scores if any(math.isinf(s.values.get(f"{n}_psnr", 0)) for n in COMPARED)]
    if not exact:
        return []
    return [
        f"{len(exact)} of the {len(scores)} pictures of {group}, such as {exact[0].name}, are left "
        "out of means of PSNR, which is infinite there: a picture that they are compared with is "
        "the same in every pixel, as it is of photographs of one colour and of copies"
    ]
