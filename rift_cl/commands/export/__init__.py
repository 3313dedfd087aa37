"""``rift export``: a scene in the files that other people's viewers, editors and printers read."""
