"""The parts of ``tools/stress_readers.py`` and ``tools/stress_scans.py``."""
