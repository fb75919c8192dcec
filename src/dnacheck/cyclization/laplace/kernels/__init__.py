"""Compiled loops: arrays in, arrays and an integer code out."""
