"""``rift demo``: its settings and its job."""
