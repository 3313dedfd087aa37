"""Lens prescriptions from files."""
