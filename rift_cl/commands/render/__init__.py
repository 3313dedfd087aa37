"""``rift render``: pictures and films of a scene."""
