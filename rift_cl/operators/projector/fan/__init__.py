"""Fans: a slice by its rays, and stacks of slices by slab tables."""
