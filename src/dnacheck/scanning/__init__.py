"""Rings and J factors of many sequences."""
