"""What commands are given: scans, scenes, and sets of views, opened and checked."""
