"""The X-ray transform and its exact adjoint, by phase tables or by the Fourier slice theorem."""
