"""The part of a chain between two sites."""

from __future__ import annotations

from dataclasses import replace

from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError

_FEWEST_STEPS = 4


def between(chain: Chain, first: int, last: int) -> Chain:
    """The steps of a chain from one base pair to another.

    Parameters
    ----------
    first, last : int
        Base pairs, from 0, the second beyond the first.

    Raises
    ------
    InputError
        A base pair outside the molecule, or fewer than four steps between the two.
    """
    for site in (first, last):
        if not 0 <= site <= chain.n_steps:
            raise InputError(
                f"site {site} lies outside {chain.name}, whose base pairs are 0 to "
                f"{chain.n_steps - 1}"
            )
    if last - first < _FEWEST_STEPS:
        raise InputError(
            f"sites {first} and {last}: the second must be at least {_FEWEST_STEPS} base pairs "
            "beyond the first"
        )
    chain.require_free("a part of a chain")
    return replace(
        chain,
        name=f"{chain.name}[{first}..{last}]",
        ground=chain.ground[first:last],
        stiffness=chain.stiffness[first:last],
        letters=chain.letters[first:last],
        a_tract_regions=(),
    )
