"""What shows on which drivers, compilers and devices the package gives the same numbers."""
