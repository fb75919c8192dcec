"""Frames and wedge angles of bead trajectories, in the manner of MDAnalysis' analyses."""

from __future__ import annotations

from typing import Any

import numpy as np
from MDAnalysis.analysis.base import AnalysisBase
from numpy.typing import NDArray

from dnacheck.md.geometry import elastic_energies_RT, frames_of_beads, step_angles
from dnacheck.md.trajectory import CENTRE_NAME, GROOVE_NAME
from dnacheck.model.chain import Chain, StepForm
from dnacheck.numerics.outcome import InputError, SolveError

Array = NDArray[np.float64]

_LONGEST = 3.0
"""Bonds and groove arms longer than so many times the usual are torn; thermal ones keep to 1.1."""


class WedgeAngles(AnalysisBase):
    """Recover base-pair frames and step angles from a trajectory of beads.

    As many groove beads as centres mean a ring; one centre more means an open chain.

    Parameters
    ----------
    universe : MDAnalysis.Universe or AtomGroup
        Beads in the order of the chain.
    chain : Chain, optional
        Checks the number of beads and adds elastic energies.
    centres, grooves : str
        Selections of the centre and the groove beads.
    step_form : {"wedge", "midstep"}
        Which angles; those of ``chain`` if it is given.

    Attributes
    ----------
    results.angles : ndarray, shape (n_frames, N, 3)
        tau, theta, phi of each step, radians.
    results.frames : ndarray, shape (n_frames, N+1, 3, 3)
        Directors in columns; a ring's first frame is repeated at the end.
    results.centres : ndarray, shape (n_frames, N+1, 3)
        In Å.
    results.elastic_RT : ndarray, shape (n_frames,)
        Energy of the steps, if a chain was given.

    Raises
    ------
    InputError
        The numbers of beads do not make a chain, or not this chain.
    SolveError
        While running: a position is not a number, two beads coincide, or the chain is torn.
        Names the frame; ``partial`` and :attr:`results` hold the frames before it.
    """

    def __init__(
        self,
        universe: Any,
        chain: Chain | None = None,
        centres: str = f"name {CENTRE_NAME}",
        grooves: str = f"name {GROOVE_NAME}",
        step_form: StepForm = "wedge",
        **keywords: Any,
    ) -> None:
        self._centres = _selected(universe, centres)
        self._grooves = _selected(universe, grooves)
        self.closed = _is_closed(len(self._centres), len(self._grooves))
        n_steps = len(self._grooves) - (0 if self.closed else 1)
        if chain is not None and n_steps != chain.n_steps:
            raise InputError(
                f"the trajectory has beads of {n_steps} steps, '{chain.name}' has {chain.n_steps}"
            )
        self.chain = chain
        self.n_steps = n_steps
        self._form: StepForm = step_form if chain is None else chain.step_form
        self._positions = np.empty((len(self._centres) + len(self._grooves), 3))
        super().__init__(universe.universe.trajectory, **keywords)

    def _prepare(self) -> None:
        self.results.angles = np.empty((self.n_frames, self.n_steps, 3))
        self.results.frames = np.empty((self.n_frames, self.n_steps + 1, 3, 3))
        self.results.centres = np.empty((self.n_frames, self.n_steps + 1, 3))

    def _single_frame(self) -> None:
        index = self._frame_index
        self._positions[0::2] = self._centres.positions
        self._positions[1::2] = self._grooves.positions
        bad = np.flatnonzero(~np.all(np.isfinite(self._positions), axis=1))
        if bad.size:
            self._stop(index, f"the position of bead {bad[0]} is not a number")
        self._check_lengths(index)
        with np.errstate(invalid="ignore", divide="ignore"):
            centres, frames = frames_of_beads(self._positions, self.closed)
        if not np.all(np.isfinite(frames)):
            pair = int(np.flatnonzero(~np.all(np.isfinite(frames), axis=(1, 2)))[0])
            self._stop(index, f"base pair {pair} has no frame, two of its beads coincide")
        self.results.centres[index] = centres
        self.results.frames[index] = frames
        self.results.angles[index] = step_angles(frames, self._form)

    def _check_lengths(self, index: int) -> None:
        """Stop at a frame whose chain is torn, as wrapping into a periodic box tears it."""
        centres, grooves = self._positions[0::2], self._positions[1::2]
        after = np.roll(centres, -1, axis=0) if self.closed else centres[1:]
        bonds = np.linalg.norm(after - centres[: len(after)], axis=1)
        arms = np.linalg.norm(grooves - centres[: len(grooves)], axis=1)
        rise = float(np.median(bonds)) if self.chain is None else self.chain.rise_A
        for lengths, usual, what in (
            (bonds, rise, "from base pair {} to the next it is {:.1f} Å, the rise is {:.1f} Å"),
            (
                arms,
                float(np.median(arms)),
                "base pair {}'s groove bead is {:.1f} Å off, not {:.1f}",
            ),
        ):
            longest = int(np.argmax(lengths))
            if lengths[longest] > _LONGEST * usual:
                text = what.format(longest, lengths[longest], usual)
                self._stop(
                    index, f"{text}; unwrap the trajectory if it is wrapped into a periodic box"
                )

    def _conclude(self) -> None:
        if self.chain is not None:
            self.results.elastic_RT = elastic_energies_RT(self.chain, self.results.angles)

    def _stop(self, index: int, reason: str) -> None:
        for name in ("angles", "frames", "centres"):
            self.results[name] = self.results[name][:index]
        self._conclude()
        raise SolveError(
            f"frame {self._ts.frame}: {reason}; {index} frames before it were analysed",
            self.results,
        )


def _selected(universe: Any, selection: str) -> Any:
    try:
        return universe.select_atoms(selection)
    except Exception as error:  # the selection language has exceptions of its own
        raise InputError(f"selection '{selection}': {error}") from error


def _is_closed(centres: int, grooves: int) -> bool:
    if grooves < 2 or centres not in (grooves, grooves + 1):
        raise InputError(
            f"{centres} centres and {grooves} groove beads make no chain; a ring has as many of "
            "both, an open chain one centre more (see --centres and --grooves)"
        )
    return centres == grooves
