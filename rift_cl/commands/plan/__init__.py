"""``rift plan``: where to take photographs from."""
