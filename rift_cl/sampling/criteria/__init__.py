"""From coverage to a number: optimality criteria (``optimality``, called by ``merit``), limits."""
