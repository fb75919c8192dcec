"""Rings and J of all windows of a record, neighbours started from each other.

Every so many windows the rings are searched for anew. Where that search and the followed rings
disagree, the windows since the last search are all searched anew, so that a minimum is missed only
if it comes and goes between two searches; ``docs/howto/run_scan.md`` states how often that was
measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.laplace.isolated import log_prefactor
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model import a_tracts
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.chain_kernels import HingeSteps
from dnacheck.model.molecules import Molecule
from dnacheck.model.parameters import load_parameters
from dnacheck.model.sequence import BASES, MINIMUM_LENGTH, parse_sequence
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.scanning import window_kernels as wk

Array = NDArray[np.float64]

LONGEST_WINDOW = 10_000
"""Longest window, in base pairs."""

SEARCH_EVERY = 32
"""Windows from one full search to the next."""
_ROOM = 24
"""Minima that are followed at once."""
_JUMP_RT = 3.0
_TOLERANCE = 1e-8
"""Of residuals; energies err by its square."""
_HEIGHT_RT = 10.0
"""Minima that lie higher above the lowest are not followed: they hold nothing of J."""
_AGREE = 1e-9
_PILOTS = 400
_SHARE = 0.95
"""Of the windows that may have two minima, those that are looked at."""
_AGREE_LN_J = 5e-4

FOUND, FREE_REGISTER, NO_RING, OTHER_LETTERS = range(4)
STATUS = (
    "ok",
    "free register, no Laplace value; use dnacheck jfactor",
    "no stable ring found at any link searched",
    "letters other than A, C, G, T",
)


@dataclass(frozen=True)
class Windows:
    """Results by window, in order of their starts.

    Attributes
    ----------
    start : ndarray, shape (W,)
        First base pair, from 0, on the strand that is read.
    link : ndarray, shape (W,)
    energy_reduced, energy_RT, minus_lnJ : ndarray, shape (W,)
        NaN where there is none.
    code : ndarray, shape (W,)
        Index into :data:`STATUS`.
    searches : int
        Full searches made.
    repaired : int
        Windows searched anew because followed rings and a search disagreed.
    """

    start: NDArray[np.int64]
    link: NDArray[np.int64]
    energy_reduced: Array
    energy_RT: Array
    minus_lnJ: Array
    code: NDArray[np.uint8]
    searches: int
    repaired: int


def letter_codes(letters: str | bytes) -> NDArray[np.uint8]:
    """Codes 0 to 3 of A, C, G, T in either case, 4 of any other letter."""
    raw = letters.encode("ascii", "replace") if isinstance(letters, str) else letters
    table = np.full(256, wk.OTHER_LETTER, dtype=np.uint8)
    for code, base in enumerate(BASES):
        table[ord(base)] = table[ord(base.lower())] = code
    return table[np.frombuffer(raw, dtype=np.uint8)]


def _every_step(letters: int) -> str:
    """The shortest closed sequence that holds every word of so many letters once (de Bruijn)."""
    seen: set[str] = set()
    text = BASES[0] * (letters - 1)
    out = []
    for _ in range(len(BASES) ** letters):
        for base in reversed(BASES):
            word = text[len(text) - letters + 1 :] + base
            if word not in seen:
                seen.add(word)
                text += base
                out.append(base)
                break
    return "".join(out)


def _tables(arguments: Mapping[str, Any]) -> tuple[wk.StepTables, Chain]:
    """Tables of all steps and a chain that has them, from the arguments of ``build_chain``."""
    choice = arguments.get("a_tracts", "auto")
    rules = {"none": wk.NO_RULE, "auto": wk.RUNS_AND_FLANKS, "tracts-only": wk.RUNS_ONLY}
    if choice not in rules:
        raise InputError(
            "--a-tracts A..B names steps of one molecule; with windows use auto or none"
        )
    table = arguments.get("angles", "trifonov2")
    table = load_parameters(table) if isinstance(table, str) else table
    width = 2 if len(table.ground) == len(BASES) ** 2 else 4
    letters = _every_step(width)
    plain = {**arguments, "angles": table, "a_tracts": "none"}
    chain = build_chain(Molecule(parse_sequence(letters, "steps")), **plain)
    codes = letter_codes(letters).astype(np.int64)
    before = 1 if width == 4 else 0
    index = np.zeros(len(codes), dtype=np.int64)
    for k in range(width):
        index = 4 * index + np.roll(codes, before - k)
    ground = np.empty_like(chain.ground)
    stiffness = np.empty_like(chain.stiffness)
    ground[index], stiffness[index] = chain.ground, chain.stiffness
    has_tracts = table.a_tract_twist is not None
    tables = wk.StepTables(
        ground,
        stiffness,
        np.linalg.slogdet(stiffness)[1],
        float(table.a_tract_twist or 0.0),
        rules[choice] if has_tracts else wk.NO_RULE,
        a_tracts.SHORTEST_RUN,
        a_tracts.LARGEST_GAP,
        a_tracts.FLANK,
    )
    return tables, chain


class WindowScanner:
    """Scans windows of one length with one set of parameters; keeps what every call needs.

    Parameters
    ----------
    window : int
        Length in base pairs.
    arguments : mapping
        Keyword arguments of :func:`dnacheck.model.chain.build_chain`.

    Raises
    ------
    InputError
        A window shorter than ten base pairs, or regions given by hand.
    """

    def __init__(self, window: int, arguments: Mapping[str, Any]) -> None:
        if window < MINIMUM_LENGTH:
            raise InputError(f"window {window}: a ring needs {MINIMUM_LENGTH} base pairs at least")
        self.window = window
        self.tables, pattern = _tables(arguments)
        n, d = window, pattern.ground.shape[1]
        ground = np.tile(pattern.ground[:1], (n, 1))
        stiffness = np.tile(pattern.stiffness[:1], (n, 1, 1))
        self.chain = replace(pattern, name="window", letters="", ground=ground, stiffness=stiffness)
        self.steps = self.chain.arrays._replace(ground=ground.copy(), stiffness=stiffness.copy())
        self.inside = np.empty(n, dtype=bool)
        self.limits = NewtonOptions(tolerance=_TOLERANCE).limits
        self.amplitude_RT = self._amplitude_of_two()
        self.minima = wk.Followed(
            np.empty((_ROOM, n, d)),
            np.empty((_ROOM, 6)),
            np.zeros((_ROOM, wk.N_FIGURES)),
            np.zeros(_ROOM, dtype=np.int64),
            np.zeros(_ROOM, dtype=bool),
        )

    def _amplitude_of_two(self) -> float:
        """Amplitude in RT up to which most random windows with room for two minima have theirs."""
        if not isinstance(self.steps, HingeSteps):
            return 0.0
        rng = np.random.default_rng(0)
        found = [0.0]
        work = wk.new_work(self.steps)
        for _ in range(_PILOTS):
            codes = rng.integers(0, len(BASES), self.window).astype(np.uint8)
            wk.fill_window(codes, 0, self.tables, self.steps, self.inside)
            link = round(float(self.steps.ground[:, 0].sum()) / (2.0 * np.pi))
            count, lacking = wk.has_room(self.steps, link, work)
            if count > 1 or lacking < wk.LACKING:
                found.append(wk.amplitude_of_link(self.steps, link, work))
        return float(np.quantile(found, _SHARE)) * self.chain.energy_scale_RT

    def chain_at(self, codes: NDArray[np.uint8], start: int) -> Chain:
        """Chain of the window at ``start``, cut where the ring of windows is."""
        wk.fill_window(codes, start, self.tables, self.steps, self.inside)
        return replace(
            self.chain, ground=self.steps.ground.copy(), stiffness=self.steps.stiffness.copy()
        )

    def scan(self, codes: NDArray[np.uint8], stride: int = 1, every: int = SEARCH_EVERY) -> Windows:
        """All windows of a stretch of letters.

        Parameters
        ----------
        codes : ndarray of uint8
            See :func:`letter_codes`.
        stride : int
            Base pairs from one window's start to the next.
        every : int
            Windows from one full search to the next; 1 searches every window anew.
        """
        count = max(0, (len(codes) - self.window) // stride + 1)
        rows = wk.WindowRows(
            np.full(count, np.nan),
            np.zeros(count, dtype=np.int64),
            np.full(count, np.nan),
            np.zeros(count, dtype=np.int64),
            np.zeros(count, dtype=np.int64),
        )
        code = np.full(count, FOUND, dtype=np.uint8)
        bad = np.concatenate([[0], np.cumsum(codes == wk.OTHER_LETTER)])
        starts = np.arange(count) * stride
        code[bad[starts + self.window] > bad[starts]] = OTHER_LETTERS
        searches = repaired = 0
        w = 0
        segment = 0  # the first window that was followed since the last search
        while w < count:
            if code[w] == OTHER_LETTERS:
                w += 1
                segment = w
                continue
            # Here a search begins a stretch that is followed; it also judges the last stretch.
            followed = (rows.energy[w], rows.log_j[w])
            found = self._search(codes, starts[w])
            searches += 1
            if found is None:
                code[w] = NO_RING
                rows.energy[w] = rows.log_j[w] = np.nan
                w += 1
                segment = w
                continue
            last = min(count, w + every)
            while last > w + 1 and code[w + 1 : last].max(initial=0) == OTHER_LETTERS:
                last = w + 1 + int(np.argmax(code[w + 1 : last] == OTHER_LETTERS))
            # One window further, to compare there; it is searched anew in any case.
            done = self._follow(codes, starts[w], stride, rows, w, min(count, last + 1))
            agree = np.isnan(followed[0]) or (
                abs(followed[0] - rows.energy[w]) <= _AGREE * abs(rows.energy[w])
                and abs(followed[1] - rows.log_j[w]) <= _AGREE_LN_J
            )
            if not agree:
                for back in range(segment + 1, w):
                    searches += 1
                    repaired += 1
                    self._single(codes, starts, back, rows, code)
            segment = w
            if done == 0:
                code[w] = NO_RING
                done = 1
            w = min(last, w + done)
        free = (rows.free > 0) & (code == FOUND)
        code[free] = FREE_REGISTER
        energy = np.where((code == FOUND) | free, rows.energy, np.nan)
        return Windows(
            start=starts,
            link=np.where(np.isnan(energy), 0, rows.link),
            energy_reduced=energy,
            energy_RT=energy * self.chain.energy_scale_RT,
            minus_lnJ=np.where(code == FOUND, -rows.log_j, np.nan),
            code=code,
            searches=searches,
            repaired=repaired,
        )

    def _search(self, codes: NDArray[np.uint8], start: int) -> Equilibria | None:
        """Fill the minima that are followed by a full search; None if there is none."""
        chain = self.chain_at(codes, start)
        try:
            found = find_rings(chain)
        except SolveError:
            return None
        rings = found.equilibria[:_ROOM]
        if not rings:
            return None
        self.minima.live[:] = False
        lowest = rings[0].energy * chain.energy_scale_RT
        for m, ring in enumerate(rings):
            if ring.energy * chain.energy_scale_RT > lowest + _HEIGHT_RT:
                continue
            self.minima.angles[m] = ring.angles
            self.minima.multipliers[m] = ring.multipliers
            self.minima.links[m] = ring.link
            self.minima.live[m] = True
        return found

    def _follow(
        self,
        codes: NDArray[np.uint8],
        start: int,
        stride: int,
        rows: wk.WindowRows,
        first: int,
        last: int,
    ) -> int:
        part = wk.WindowRows(*(column[first:last] for column in rows))
        chain = self.chain
        constant = log_prefactor(chain) - 0.5 * float(np.linalg.slogdet(chain.stiffness)[1].sum())
        judgement = wk.Judgement(chain.energy_scale_RT, constant, _JUMP_RT, self.amplitude_RT)
        return int(
            wk.follow_windows(
                codes,
                start,
                stride,
                self.tables,
                self.steps,
                self.limits,
                judgement,
                self.minima,
                part,
            )
        )

    def _single(
        self,
        codes: NDArray[np.uint8],
        starts: NDArray[np.int64],
        w: int,
        rows: wk.WindowRows,
        code: NDArray[np.uint8],
    ) -> None:
        """One window by a full search of its own."""
        if self._search(codes, starts[w]) is None or not self._follow(
            codes, starts[w], 1, rows, w, w + 1
        ):
            code[w] = NO_RING
