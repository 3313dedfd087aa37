"""Lengths of a scan from a point: what a detector's pixel is at the rotation axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rift_cl.geometry import Cone, Fan, Vectors


class ScanLengths(NamedTuple):
    """Lengths that most views of a scan have.

    Args:
        source_to_axis: distance of the source from the axis.
        source_to_detector: distance of the source from the detector.
        pitch: distance between rows and between bins on the detector.
    """

    source_to_axis: float
    source_to_detector: float
    pitch: tuple[float, float]

    @property
    def pixel(self) -> tuple[float, float]:
        """Distance between rows and between bins as they are seen at the axis."""
        share = self.source_to_axis / self.source_to_detector
        return self.pitch[0] * share, self.pitch[1] * share


def scan_lengths(scan: Fan | Cone | Vectors) -> ScanLengths:
    """Lengths of a scan; of vectors, the medians over the views.

    Args:
        scan: a fan's pitch counts for rows as well.
    """
    if isinstance(scan, Vectors):
        normal = np.cross(scan.across, scan.down)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        to_detector = np.abs(((scan.middle - scan.source) * normal).sum(axis=1))
        to_axis = np.hypot(scan.source[:, 0], scan.source[:, 1])
        pitch = [np.median(np.linalg.norm(v, axis=1)) for v in (scan.down, scan.across)]
        lengths = float(np.median(to_axis)), float(np.median(to_detector))
        return ScanLengths(*lengths, (float(pitch[0]), float(pitch[1])))
    pitch_of = scan.pitch if isinstance(scan, Cone) else (scan.pitch, scan.pitch)
    return ScanLengths(scan.source_to_axis, scan.source_to_detector, pitch_of)
