"""``rift fit photos``: splats from posed photographs."""
