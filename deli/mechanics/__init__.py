"""Scenes, potentials, constraint families, discrete Lagrangians, energies and momenta."""
