"""The geometry of circular scans from their own data: rays that measure the same line must agree.

``calibrate`` corrects a scan; ``opposite_fit`` fits roll and distance of the detector.
"""

from rift_cl.reconstruct.calibration.calibrate import Calibration, calibrate, rolled

__all__ = ["Calibration", "calibrate", "rolled"]
