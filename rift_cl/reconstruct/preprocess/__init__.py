"""Corrections of projections before reconstruction: flat field, rings, zingers, phase, alignment.

Stripes, zingers, beam hardening and phase; binning, a tilted axis, and half acquisitions.
"""

from rift_cl.reconstruct.preprocess.alignment import most_tilt, straightened, tilt_halo, upright
from rift_cl.reconstruct.preprocess.binning import (
    binned,
    binned_center,
    binned_scan,
    binning_note,
)
from rift_cl.reconstruct.preprocess.half_acquisition import stitched
from rift_cl.reconstruct.preprocess.hardening import linearised
from rift_cl.reconstruct.preprocess.paganin import Propagation, halo_rows, paganin
from rift_cl.reconstruct.preprocess.rings import STRIPE_METHODS, remove_rings
from rift_cl.reconstruct.preprocess.zingers import remove_zingers

__all__ = [
    "STRIPE_METHODS",
    "Propagation",
    "binned",
    "binned_center",
    "binned_scan",
    "binning_note",
    "halo_rows",
    "linearised",
    "most_tilt",
    "paganin",
    "remove_rings",
    "remove_zingers",
    "stitched",
    "straightened",
    "tilt_halo",
    "upright",
]
