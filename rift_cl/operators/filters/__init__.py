"""Filters along the detector, and density compensation for directions that lie unevenly."""
