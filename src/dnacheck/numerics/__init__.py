"""Rotations, statuses and statistics: what every other layer stands on."""
