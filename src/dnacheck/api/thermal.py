"""``ensemble``: a closed ring in thermal motion, by two programs that share no code."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dnacheck.api.arguments import Progress, one_of, thread_count, told, whole
from dnacheck.equilibria.boundary import Ring
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import Randomness, seed_sequence

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]


class Mean(NamedTuple):
    """Mean over an ensemble, with its standard error."""

    mean: float
    stderr: float


@dataclass(frozen=True, eq=False)
class ThermalRing:
    """A closed ring in thermal motion.

    Attributes
    ----------
    ring : Equilibrium
        The minimum about which it moves.
    by : "monte-carlo" or "openmm"
    samples : int
    energy_RT : Mean
        Elastic energy; a harmonic ring's would be ``equipartition_RT``.
    writhe : Mean
        Turns.
    radius_of_gyration_A : Mean
    angle_mean_deg, angle_deviation_deg : ndarray, shape (N, 3)
        tau, theta, phi of each step: means and standard deviations over the ensemble.
    fluctuation_A : ndarray, shape (N,)
        Root mean square distance of each base pair's centre from its place after superposition: on
        the mean structure (Monte Carlo), on the minimum (OpenMM).
    seconds : float
    """

    ring: Equilibrium
    by: str
    samples: int
    energy_RT: Mean
    writhe: Mean
    radius_of_gyration_A: Mean
    angle_mean_deg: Array
    angle_deviation_deg: Array
    fluctuation_A: Array
    seconds: float

    @property
    def equipartition_RT(self) -> float:
        """Energy of the minimum and half an RT for each of its 3N - 6 free directions."""
        return self.ring.energy_RT + 0.5 * (3 * self.ring.n_bp - 6)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers; arrays as nested lists."""
        return {
            "target": self.ring.name,
            "by": self.by,
            "samples": self.samples,
            **{
                name: getattr(self, name)._asdict()
                for name in ("energy_RT", "writhe", "radius_of_gyration_A")
            },
            "equipartition_RT": self.equipartition_RT,
            **{
                name: getattr(self, name).tolist()
                for name in ("angle_mean_deg", "angle_deviation_deg", "fluctuation_A")
            },
            "seconds": self.seconds,
        }

    def to_frame(self) -> pandas.DataFrame:
        """A row for each base pair and the step after it: angles in degrees, fluctuation in Å."""
        import pandas

        columns = {"fluctuation_A": self.fluctuation_A}
        for i, name in enumerate(("tau", "theta", "phi")):
            columns[f"{name}_mean_deg"] = self.angle_mean_deg[:, i]
            columns[f"{name}_deviation_deg"] = self.angle_deviation_deg[:, i]
        return pandas.DataFrame(columns)

    def __repr__(self) -> str:
        mean, error = self.energy_RT
        return (
            f"<{self.ring.name} in thermal motion ({self.by}, {self.samples} samples): energy "
            f"{mean:.2f} ± {error:.2f} RT, harmonic {self.equipartition_RT:.2f}; writhe "
            f"{self.writhe.mean:+.4f} ± {self.writhe.stderr:.4f}>"
        )


def ensemble(
    ring: Equilibrium,
    by: Literal["monte-carlo", "openmm"] = "monte-carlo",
    *,
    samples: int = 1000,
    rng: Randomness = 0,
    threads: int | None = None,
    progress: Progress = False,
) -> ThermalRing:
    """Thermal ensemble about a discrete ring: constrained Monte Carlo, or OpenMM's bead chain.

    Parameters
    ----------
    ring : Equilibrium
        A stable ring of a chain with three angles a step.
    by : "monte-carlo" or "openmm"
        Moves that keep the chain closed, or Langevin dynamics of beads that shares no code with the
        solver.
    samples : int
        Configurations in all: of four Monte Carlo copies, or of two replicas.
    rng : int, SeedSequence or Generator
    threads : int, optional
    progress : bool or callable
        Told of OpenMM's configurations.

    Returns
    -------
    ThermalRing

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        The dynamics blew up.

    Examples
    --------
    >>> import dnacheck as dc
    >>> ring = dc.rings("11T15").lowest
    >>> moving = dc.ensemble(ring, samples=80)
    >>> moving.samples, moving.fluctuation_A.shape
    (80, (158,))
    """
    one_of("by", by, ("monte-carlo", "openmm"))
    whole("samples", samples, 80)
    if not isinstance(ring, Equilibrium):
        raise InputError(f"ring must be an equilibrium, as rings(...).lowest, not {ring!r}")
    chain = ring.chain
    chain.require_hinges("a thermal ensemble")
    if ring.boundary != Ring() or ring.stable is False:
        raise InputError("ring must be closed and stable; give rings(chain).lowest")
    seed, count = seed_sequence(rng), thread_count(threads)
    if by == "openmm":
        return _openmm(ring, samples, seed, count, progress)
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble

    options = ClosedRingOptions(samples=-(-samples // 4), threads=count)
    found = closed_ring_ensemble(chain, ring, options, np.random.default_rng(seed))
    return ThermalRing(
        ring,
        by,
        found.samples,
        Mean(found.energy_RT.mean, found.energy_RT.stderr),
        Mean(found.writhe.mean, found.writhe.stderr),
        Mean(found.radius_of_gyration_A.mean, found.radius_of_gyration_A.stderr),
        np.degrees(found.angle_mean),
        np.degrees(found.angle_deviation),
        found.fluctuation_A,
        found.seconds,
    )


def _openmm(
    ring: Equilibrium, samples: int, seed: np.random.SeedSequence, threads: int, progress: Progress
) -> ThermalRing:
    from dnacheck.md.bead_chain import BeadChain
    from dnacheck.md.ensemble import EnsembleOptions, sample_ensemble
    from dnacheck.md.ensemble_statistics import analyse_ensemble

    options = EnsembleOptions(
        samples=math.ceil(samples / 2), seed=int(seed.generate_state(1)[0] >> 1)
    )
    start = BeadChain(ring.chain, True).positions(np.array(ring.angles))
    with told(progress, f"{ring.name}: configurations", 2 * options.samples) as advance:
        sampled = sample_ensemble(
            ring.chain, start, True, options, threads=threads, progress=advance
        )
    found = analyse_ensemble(sampled, ring.energy_RT, start[0::2])
    return ThermalRing(
        ring,
        "openmm",
        found.frames,
        Mean(found.elastic_RT.mean, found.elastic_RT.stderr),
        Mean(found.writhe.mean, found.writhe.stderr),
        Mean(found.radius_of_gyration_A.mean, found.radius_of_gyration_A.stderr),
        np.degrees(found.angle_mean),
        np.degrees(np.sqrt(found.angle_variance)),
        found.fluctuation_A,
        sampled.seconds,
    )
