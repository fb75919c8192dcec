"""Ranges of the chain's parameters: wide of any polymer, and inside what double precision solves.

Single-stranded DNA bends over 10 Å and actin over 10⁵ Å; a monomer of any of them rises by 0.1 Å
to 100 Å. Between a rod that twists a hundred times more easily than it bends and one that bends a
hundred times more easily, the stiffness matrix loses four of its sixteen digits.
"""

from __future__ import annotations

from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.ranges import Range

PERSISTENCE_LENGTH_A = Range(1.0, 1e5, "Å")
RISE_A = Range(0.1, 100.0, "Å")
TWIST_RATIO = Range(0.01, 100.0)


def check_link(link: int | str, n_bp: int) -> None:
    """Refuse a link that no ring of so many base pairs can have.

    A step turns by half a turn at most; beyond it is the same step turning the other way.

    Raises
    ------
    InputError
    """
    most = n_bp // 2
    if isinstance(link, int) and abs(link) > most:
        raise InputError(f"link {link}: a ring of {n_bp} bp has links from {-most} to {most}")
