"""Cones, and any places of source and detector: by slab tables."""
