"""What is mended in projections before they are reconstructed: stripes, zingers, phase."""

from rift_cl.reconstruct.preprocess.rings import STRIPE_METHODS, remove_rings

__all__ = ["STRIPE_METHODS", "remove_rings"]
