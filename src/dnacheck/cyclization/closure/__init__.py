"""Importance sampling of exactly closed shapes."""
