"""Fits of X-ray scans: splats with densities, and least squares for what is linear in them."""
