"""Scenes: which molecules, which model, which quantities, how accurate."""
