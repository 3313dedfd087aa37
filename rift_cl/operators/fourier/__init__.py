"""Fourier transforms on the device, and responses applied in the Fourier domain."""
