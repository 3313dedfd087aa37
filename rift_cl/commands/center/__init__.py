"""``rift center``: estimates the rotation axis of a scan."""
