"""Splats as viewers and editors of other makers read them: one module a format, writers alone.

Every encoder takes a scene of plain splats (opacities, harmonics, no modes) and gives back the
bytes of one file, the same bytes for the same splats: no date, no path, no name of a machine. What
a format rounds, and what it cannot hold, its module says first. Reading back is left to programs
that other people wrote (``tools/check_exports.py``), so that a mistake cannot cancel itself.
"""
