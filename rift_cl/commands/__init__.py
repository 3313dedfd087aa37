"""The command line: every command in a room of its own, and what commands have in common."""
