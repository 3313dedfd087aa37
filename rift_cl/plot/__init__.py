"""Figures of reports, drawn without a display: images, curves, frequencies, directions, cameras."""

from rift_cl.plot.camera_plot import Stands, camera_plot
from rift_cl.plot.curves import curves
from rift_cl.plot.direction_map import direction_maps
from rift_cl.plot.figure import WIDE, figure_png, figure_svg, figure_svgs
from rift_cl.plot.frames import framed, jpeg
from rift_cl.plot.frequency_map import FrequencySlice, frequency_maps
from rift_cl.plot.panels import image_grid

__all__ = [
    "WIDE",
    "FrequencySlice",
    "Stands",
    "camera_plot",
    "curves",
    "direction_maps",
    "figure_png",
    "figure_svg",
    "figure_svgs",
    "framed",
    "frequency_maps",
    "image_grid",
    "jpeg",
]
