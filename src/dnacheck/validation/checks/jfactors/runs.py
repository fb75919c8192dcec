"""Chains, seeds and closure samples that the checks of J factors share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dnacheck.validation.engine.context import Context

if TYPE_CHECKING:
    from dnacheck.cyclization.result import JFactor
    from dnacheck.model.chain import Chain

BEST = ("09T15", "08T15", "08A17")
"""The three best cyclizers of Table III, on which the slow methods are tried."""


def sampled(chain: Chain, tolerance: float, seed: int) -> JFactor:
    """Exact-closure sampling to a standard error."""
    from dnacheck.cyclization.methods import ClosureSampling

    return ClosureSampling().compute(chain, rng=seed, tolerance=tolerance)


def chains(context: Context) -> list[Chain]:
    """Chains of the scene's molecules."""
    from dnacheck.validation.engine.rings import scene_chain

    return [scene_chain(context.scene, molecule) for molecule in context.molecules]


def row(result: JFactor) -> dict[str, Any]:
    """A result as a row of a table."""
    return {
        "name": result.target,
        "minus_lnJ": result.minus_lnJ,
        "stderr": result.stderr,
        "bias": result.bias_bound,
        "effective": result.effective_samples,
        "seconds": result.seconds,
        "status": result.status.value,
    }
