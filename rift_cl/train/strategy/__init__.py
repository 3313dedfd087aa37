"""Strategies: where splats come from and go to while they are trained."""
