"""Other packages' tensors, names and conventions. Each module loads the package it is named for."""
