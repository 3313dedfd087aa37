"""The parts of ``tools/bench_kernels.py``; scripts, which the package never imports."""
