"""Iterative reconstruction: the solvers, their data terms and their priors."""
