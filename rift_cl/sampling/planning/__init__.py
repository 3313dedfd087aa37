"""The planner: constraints, candidate views, greedy selection and refinement by gradients."""
