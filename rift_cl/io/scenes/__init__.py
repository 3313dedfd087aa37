"""Scenes of splats, and meshes, in the files that other programs read."""
