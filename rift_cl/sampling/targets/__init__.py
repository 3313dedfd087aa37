"""Targets of a plan: extent, prior spectrum, free space, and observations of points by views."""
