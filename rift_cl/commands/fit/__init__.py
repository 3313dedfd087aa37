"""What every fit has, of photographs or X-rays: the run, its checkpoints, its cost."""
