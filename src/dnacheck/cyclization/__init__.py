"""Cyclization probabilities (J factors) by independent methods."""
