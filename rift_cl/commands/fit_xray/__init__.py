"""``rift fit xray``: splats from the projections of an X-ray scan."""
