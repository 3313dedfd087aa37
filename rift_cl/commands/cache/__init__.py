"""``rift cache``: the compiled kernels that drivers keep."""
