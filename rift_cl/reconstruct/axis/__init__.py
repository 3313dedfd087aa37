"""The rotation axis: its detector bin, a confidence interval, and its tilt.

``search`` asks several rows and draws a line through their answers; ``measures`` says how one row
is searched, by a measure that the directions of its views allow. The measures are
``opposite_views``, ``double_wedge`` and ``moments``, one a file; the first two hand over
``evidence``, a phase for every frequency along the detector. ``circular`` asks the same of fans and
cones, whose rays ``fan_rays`` reads as parallel views, and ``sense`` which way they turned.
``turn`` and ``repeated`` say what views have against their angles.
"""

from rift_cl.reconstruct.axis.center import find_center
from rift_cl.reconstruct.axis.circular import axis_of_scan
from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.axis.search import axis_of_stack
from rift_cl.reconstruct.axis.sense import Sense

__all__ = [
    "AxisEstimate",
    "Sense",
    "axis_of_scan",
    "axis_of_stack",
    "find_center",
]
