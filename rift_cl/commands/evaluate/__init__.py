"""``rift eval``: scores of a scene on held-out photographs, beside baselines."""
