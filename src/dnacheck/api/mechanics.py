"""``sensitivity``, ``profile`` and ``fit``: from J to the mechanics of the molecule, and back."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dnacheck.api.arguments import Progress, positive, thread_count, told, whole
from dnacheck.api.cyclization import method_of
from dnacheck.api.molecules import Target, chain, molecule
from dnacheck.cyclization.method import Method
from dnacheck.model.chain import Chain
from dnacheck.model.molecules import Molecule
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import Randomness, seed_sequence

if TYPE_CHECKING:
    from dnacheck.mechanics.fit import MechanicsFit, Prior
    from dnacheck.mechanics.profile import LengthProfile
    from dnacheck.mechanics.sensitivity import Sensitivity


def sensitivity(
    target: Target,
    *,
    compute: int = 30,
    tolerance: float = 0.02,
    rng: Randomness = 0,
    threads: int | None = None,
    progress: Progress = False,
    **parameters: Any,
) -> Sensitivity:
    """What each step and each letter does to ln J: derivatives, and all single substitutions.

    Parameters
    ----------
    target : what :func:`dnacheck.chain` takes
    compute : int
        Substitutions computed anew: those with the largest predicted change.
    tolerance : float
        Standard error asked for of each ln J.
    rng, threads, progress
        As in :func:`dnacheck.jfactor`.
    **parameters
        Of :func:`dnacheck.chain`: parameters, twist_ratio, a_tracts ...

    Returns
    -------
    Sensitivity
        ``.steps``, ``.substitutions``, ``.most(10)``, ``.to_frame()``, ``.to_dict()``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        The molecule has no J.

    Examples
    --------
    >>> import dnacheck as dc
    >>> found = dc.sensitivity("11T15", compute=0, tolerance=0.2)
    >>> found.steps.ground.shape, len(found.substitutions)
    ((158, 3), 474)
    """
    from dnacheck.mechanics.sensitivity import sensitivity_of

    item = molecule(target)

    def rebuild(letters: str) -> Chain:
        sequence = parse_sequence(letters, item.name)
        return chain(Molecule(sequence, item.a_tract_regions), **parameters)

    count = whole("compute", compute, 0)
    with told(progress, "substitutions", count) as advance:
        return sensitivity_of(
            chain(item, **parameters),
            rebuild,
            tolerance=positive("tolerance", tolerance),
            compute=count,
            rng=seed_sequence(rng),
            threads=thread_count(threads),
            progress=advance,
        )


def profile(
    target: Target,
    change: Sequence[int] = range(-12, 13),
    *,
    place: int | None = None,
    filler: str = "ACGTTGCATC",
    method: Method | str | None = None,
    tolerance: float = 0.02,
    rng: Randomness = 0,
    threads: int | None = None,
    progress: Progress = False,
    **parameters: Any,
) -> LengthProfile:
    """J against length, base pairs being added or removed at one place.

    Parameters
    ----------
    target : what :func:`dnacheck.chain` takes
    change : sequence of int
        Base pairs more, or, negative, fewer.
    place : int, optional
        Base pair, from 0, before which they go in; the end by default.
    filler : str
        Letters that are added, repeated.
    method, tolerance, rng, threads, progress
        As in :func:`dnacheck.jfactor`; every length starts from the same random numbers.
    **parameters
        Of :func:`dnacheck.chain`.

    Returns
    -------
    LengthProfile
        ``.n_bp``, ``.minus_lnJ``, ``.period``, ``.helical_repeat``, ``.to_frame()``,
        ``.to_dict()``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        No length has a J.

    Examples
    --------
    >>> import dnacheck as dc
    >>> found = dc.profile("11T15", range(-6, 7, 3), method="laplace")
    >>> [int(n) for n in found.n_bp]
    [152, 155, 158, 161, 164]
    """
    from dnacheck.mechanics.profile import length_profile

    way = method_of(method)
    positive("tolerance", tolerance)
    seed_sequence(rng)
    try:
        steps = [whole("change", int(step), -(10**9)) for step in change]
    except (TypeError, ValueError):
        raise InputError(f"change must be a sequence of integers, not {change!r}") from None
    with told(progress, "lengths", len(steps)) as advance:
        return length_profile(
            molecule(target),
            steps,
            lambda item: way.compute(chain(item, **parameters), rng=rng, tolerance=tolerance),
            place=place,
            filler=filler,
            threads=thread_count(threads),
            progress=advance,
        )


def fit(
    data: str | os.PathLike[str] | Sequence[Any],
    free: Sequence[str] = ("persistence_length_A", "twist_ratio", "twist_offset_deg", "bend_scale"),
    *,
    priors: Mapping[str, Prior | tuple[float, float]] | None = None,
    robust: bool = False,
    tolerance: float = 0.02,
    rng: int = 0,
    threads: int | None = None,
    progress: Progress = False,
    **parameters: Any,
) -> MechanicsFit:
    """Mechanics from measured J factors, with what the data cannot see.

    Parameters
    ----------
    data : path or sequence of Measurement
        CSV with the columns molecule, minus_lnJ (or J_molar), stderr, optionally group and name.
    free : sequence of str
        Parameters to fit; also offset, offset[GROUP], tau[AA] ...
    priors : mapping of str to (mean, standard error) or Prior, optional
        Normal priors.
    robust : bool
        Huber's loss, which forgives outliers.
    tolerance : float
        Standard error of each computed ln J.
    rng : int
        Seed of all iterations.
    threads, progress
        As in :func:`dnacheck.jfactor`.
    **parameters
        Of :func:`dnacheck.chain`.

    Returns
    -------
    MechanicsFit
        ``.parameters``, ``.covariance``, ``.directions``, ``.leave_one_out``, ``.to_frame()``,
        ``.to_dict()``.

    Raises
    ------
    InputError
        One line that names the argument, or the row of the file, and the mend.
    SolveError
        A molecule has no ring at the parameters reached.

    Examples
    --------
    >>> import dnacheck as dc
    >>> found = dc.fit("measured.csv", ["persistence_length_A"])  # doctest: +SKIP
    >>> found.to_frame()  # doctest: +SKIP
    """
    from dnacheck.mechanics.fit import FitOptions, fit_mechanics
    from dnacheck.mechanics.measurements import read_measurements

    read = isinstance(data, (str, os.PathLike))
    measurements = read_measurements(Path(data)) if read else tuple(data)  # type: ignore[arg-type]
    if isinstance(free, str):
        raise InputError(f"free must be a sequence of names, not {free!r}")
    options = FitOptions(
        tolerance=positive("tolerance", tolerance),
        robust=robust,
        seed=whole("rng", rng, 0),
        threads=thread_count(threads),
    )
    with told(progress, "iterations", None) as advance:
        step: Callable[[int, float], None] = lambda number, rms: advance(1)  # noqa: E731
        return fit_mechanics(
            measurements,
            [chain(item.molecule, **parameters) for item in measurements],
            list(free),
            {name: _prior(name, item) for name, item in (priors or {}).items()},
            options,
            step,
        )


def _prior(name: str, value: Any) -> Prior:
    from dnacheck.mechanics.fit import Prior

    if isinstance(value, Prior):
        return value
    try:
        mean, error = (float(x) for x in value)
    except (TypeError, ValueError):
        raise InputError(
            f"priors: '{name}' needs a mean and a standard error, not {value!r}"
        ) from None
    return Prior(mean, error)
