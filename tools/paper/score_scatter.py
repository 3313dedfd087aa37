"""Panels of dots: the error of each set of views against what a score said beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rift_cl.report.plot.figure import COLORS, INK, LINE, POINTS, SOFT, new_figure


def score_scatter(
    families: Sequence[str],
    scores: Mapping[str, Sequence[float]],
    errors: Sequence[float],
    what: str,
) -> Any:
    """A figure with a panel for each score, both axes logarithmic, a colour for each family.

    Args:
        families: of each set.
        scores: of each set, under the name of the score.
        errors: of each set.
        what: the error is.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(1360, 480)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    panels = figure.subplots(1, len(scores), sharey=True, squeeze=False)[0]
    for axes, (name, values) in zip(panels, scores.items(), strict=True):
        for color, family in zip(COLORS, dict.fromkeys(families), strict=False):
            mine = [index for index, one in enumerate(families) if one == family]
            x, y = [values[index] for index in mine], [errors[index] for index in mine]
            axes.plot(x, y, "o", color=color, markersize=4, label=family)
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(name, fontsize=POINTS, color=INK)
        axes.tick_params(which="both", labelsize=POINTS - 1, labelcolor=SOFT, color=LINE)
        axes.spines[:].set(color=LINE, linewidth=0.6)
    panels[0].set_ylabel(what, fontsize=POINTS, color=INK)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right center", fontsize=POINTS, frameon=False)
    return figure
