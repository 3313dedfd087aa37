"""Images and films, in and out."""
