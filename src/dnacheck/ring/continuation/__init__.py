"""Families of continuum rings: pseudo-arclength continuation, branch points, diagrams."""
