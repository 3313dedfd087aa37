"""How densely views sample the Fourier domain of a target."""
