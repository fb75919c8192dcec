"""How many threads this process may use."""

from __future__ import annotations

import os


def available_processors() -> int:
    """Processors that this process may use."""
    try:
        return max(1, len(os.sched_getaffinity(0)))
    except AttributeError:  # not offered by every operating system
        return os.cpu_count() or 1
