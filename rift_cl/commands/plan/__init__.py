"""``rift plan``: views of a target that minimize its posterior uncertainty."""
