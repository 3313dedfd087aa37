"""``rift samples``: captures of the package, and open data sets of other people."""
