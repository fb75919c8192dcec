"""Compiled loops of the discrete solver: arrays in, arrays and an integer code out."""
