"""``rift cache``: the compiled kernels that are kept."""
