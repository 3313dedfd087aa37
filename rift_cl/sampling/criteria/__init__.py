"""From coverage to a number: optimality criteria, sufficiency, limits of resolution."""
