"""``rift export``: a scene in the file formats of other viewers, editors and printers."""
