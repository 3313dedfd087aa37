"""Splats: project, sort into tiles, rasterize, and the gradients of all of it."""
