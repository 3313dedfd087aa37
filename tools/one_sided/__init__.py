"""Captures that face their subject from one side: a wall, and a shelf."""
