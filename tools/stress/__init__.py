"""The parts of ``tools/stress_readers.py``; scripts, which the package never imports."""
