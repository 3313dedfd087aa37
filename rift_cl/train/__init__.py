"""What a trainer of splats needs on the device: losses with their gradients."""
