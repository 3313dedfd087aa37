"""``rift analyze``: what views sampled, what they missed, what limits detail, what to add."""
