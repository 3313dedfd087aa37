"""``rift sweep``: one command with many settings or inputs, side by side."""
