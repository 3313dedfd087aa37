"""Figures of reports, drawn without a display: images, curves, frequencies, directions, cameras."""

from rift_cl.report.plot.camera_plot import Stands, camera_plot
from rift_cl.report.plot.curves import curves
from rift_cl.report.plot.direction_map import direction_maps
from rift_cl.report.plot.figure import WIDE, figure_png, figure_svg, figure_svgs
from rift_cl.report.plot.frames import framed, jpeg
from rift_cl.report.plot.frequency_map import FrequencySlice, frequency_maps
from rift_cl.report.plot.panels import image_grid
from rift_cl.report.plot.section_map import section_map

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
    "section_map",
]
