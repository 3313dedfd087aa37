"""A glossy ornament with hairs and fibres, rendered by an independent path tracer."""
