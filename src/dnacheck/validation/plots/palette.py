"""Colours of the report, distinguishable in print and with any kind of colour vision."""

from __future__ import annotations

INK = "#1c2733"
QUIET = "#6b7885"
HAIR = "#d5dbe1"
BLUE = "#1f5fa8"
RUST = "#b4511f"
GREEN = "#2e7d4f"
PLUM = "#7a3e8e"
GOLD = "#b8860b"
TEAL = "#18838a"
CYCLE = (BLUE, RUST, GREEN, PLUM, GOLD, TEAL, "#c2185b", "#556b2f", "#455a9c", "#8d5524", "#37474f")
