"""Small chains that the bead-chain tests share."""

from __future__ import annotations

import numpy as np

from dnacheck.model.chain import Chain, uniform_stiffness


def ring_chain(n_steps: int = 42, name: str = "small") -> Chain:
    """A chain that closes at link 4, with bends that differ from step to step."""
    i = np.arange(n_steps)
    phase = 2.0 * np.pi * 4.0 * i / n_steps
    ground = np.stack(
        [
            np.full(n_steps, 2.0 * np.pi * 4.1 / n_steps),
            0.15 * np.cos(phase) + 0.02 * np.sin(i),
            0.15 * np.sin(phase) - 0.02 * np.cos(2.0 * i),
        ],
        axis=1,
    )
    return Chain(name, ground, uniform_stiffness(n_steps, 1.5))


def coupled_stiffness(n_steps: int, seed: int = 3) -> np.ndarray:
    """Positive stiffnesses (n_steps, 3, 3) with all couplings, different at every step."""
    noise = 0.4 * np.random.default_rng(seed).standard_normal((n_steps, 3, 3))
    return uniform_stiffness(n_steps, 1.5) + noise @ np.swapaxes(noise, 1, 2)
