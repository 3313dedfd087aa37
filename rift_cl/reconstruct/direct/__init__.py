"""Filtered backprojection, with view weights, padding, offset axes and fan-beam rebinning."""
