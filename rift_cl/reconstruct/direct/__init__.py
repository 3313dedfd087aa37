"""Reconstruction by integration: filtered backprojection, and what makes scans fit for it."""
