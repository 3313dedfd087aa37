"""Captures: posed photographs of one scene, as each program in the field writes them."""
