"""Laplace's approximation: isolated, register-constrained, with its anharmonic term."""
