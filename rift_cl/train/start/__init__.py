"""Where splats begin."""
