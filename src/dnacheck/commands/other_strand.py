"""What the other strand of a molecule gives, where the form of the steps makes it differ."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from dnacheck.commands.common import ModelSettings
    from dnacheck.model.chain import Chain
    from dnacheck.model.molecules import Molecule

Function = TypeVar("Function", bound=Callable[..., Any])


def other_strand_option(function: Function) -> Function:
    """``--other-strand/--no-other-strand``, on unless said, received as ``both_strands``."""
    return click.option(
        "--other-strand/--no-other-strand",
        "both_strands",
        default=True,
        help="Compute the other strand's value too, where it differs.  [default: yes]",
    )(function)


def other_strand_chain(molecule: Molecule, chain: Chain, model: ModelSettings) -> Chain | None:
    """The chain of a ring read on its other strand; None where it is the same elastic chain.

    The wedge form turns a step about the axes of its first base pair, so that reading the ring the
    other way makes another chain; the mid-step form and steps of six parameters know no strand.
    Where a guest is bound, what its steps become is given for one strand alone.
    """
    from dnacheck.model.chain import build_chain

    if chain.step_form != "wedge" or chain.guests:
        return None
    arguments = {**model.build_arguments(), "a_tracts": "auto"}
    return build_chain(molecule.other_strand(chain.a_tract_regions), **arguments)


def remark(molecule: Molecule, value: str) -> str:
    """One line for the reader: the value of the other strand and, for one's own molecule, advice.

    The embedded molecules are the paper's and keep its form.
    """
    from dnacheck.model.molecules import is_embedded

    text = f"other strand: {value} (step form wedge"
    own = not is_embedded(molecule.name)
    return text + (", the default; --step-form midstep gives one value for both)" if own else ")")
