"""``rift eval``: the quality of a scene, measured against photographs of it."""
