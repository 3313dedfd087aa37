"""The X-ray transform and its exact adjoint, of parallel, fan and cone beams: a room for each."""
