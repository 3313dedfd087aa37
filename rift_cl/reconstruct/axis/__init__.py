"""The rotation axis: its detector bin, a confidence interval, and its tilt.

``search`` asks several rows and draws a line through their answers; ``measures`` says how one row
is searched, by a measure that the directions of its views allow. The measures are
``opposite_views``, ``double_wedge`` and ``moments``, one a file; the first two hand over
``evidence``, a phase for every frequency along the detector.
"""

from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.axis.search import axis_of_rows, find_center, searched_rows

__all__ = ["AxisEstimate", "axis_of_rows", "find_center", "searched_rows"]
