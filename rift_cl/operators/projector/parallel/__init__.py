"""Parallel beams: by phase tables, or by the Fourier slice theorem."""
