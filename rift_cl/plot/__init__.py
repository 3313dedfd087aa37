"""Figures of reports: panels of images and families of curves, drawn without a display."""

from rift_cl.plot.curves import curves
from rift_cl.plot.figure import figure_png
from rift_cl.plot.panels import image_grid

__all__ = ["curves", "figure_png", "image_grid"]
