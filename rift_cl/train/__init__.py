"""Training splats on the device: the loss, its gradient, and what steps along it."""
