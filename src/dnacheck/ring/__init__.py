"""Closed rings: discrete equilibria, continuum equilibria, and the way between them."""
