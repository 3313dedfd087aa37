"""``rift center``: where the rotation axis of a scan is."""
