"""Compiled parts of the continuum ring solver: arrays in, arrays and an integer code out."""
