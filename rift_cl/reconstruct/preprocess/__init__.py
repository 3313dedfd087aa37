"""What is mended in projections before they are reconstructed: stripes, zingers, phase."""

from rift_cl.reconstruct.preprocess.paganin import Propagation, halo_rows, paganin
from rift_cl.reconstruct.preprocess.rings import STRIPE_METHODS, remove_rings

__all__ = ["STRIPE_METHODS", "Propagation", "halo_rows", "paganin", "remove_rings"]
