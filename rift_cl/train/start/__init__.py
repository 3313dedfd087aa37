"""Initial splats: on sparse points, in a visual hull, at random, or from an FBP slice."""
