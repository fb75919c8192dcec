"""``--bind``: the chain that a command works on, with what is bound to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain


def with_guests(chain: Chain, bind: tuple[str, ...]) -> Chain:
    """The chain with everything bound that ``--bind`` names."""
    from dnacheck.model import guests

    for text in bind:
        chain = guests.bind(chain, *guests.parse_site(text, chain.n_steps))
    return chain
