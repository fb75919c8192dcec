"""Closed equilibria: discrete chains, continuum rods, the way between them, and continuation."""
