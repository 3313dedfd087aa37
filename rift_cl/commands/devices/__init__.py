"""``rift devices``: the OpenCL devices of this computer."""
