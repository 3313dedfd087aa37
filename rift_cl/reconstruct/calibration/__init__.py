"""The geometry of circular scans from their own data: rays that measure the same line must agree.

``calibrate`` corrects a scan; ``opposite_fit`` fits roll, slant and distance of the detector,
``orbit_row`` finds the row of the source's orbit.
"""

from rift_cl.reconstruct.calibration.calibrate import Calibration, calibrate
from rift_cl.reconstruct.calibration.turned_detector import turned

__all__ = ["Calibration", "calibrate", "turned"]
